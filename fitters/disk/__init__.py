"""Fitters of a bare round disk."""
