"""Fixture compensation of the 4294A: open, short, load."""
