"""Fitters and diagnoses, each in a process of its own."""
