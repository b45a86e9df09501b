"""Samples as the journal or a folder holds them, and results written back to them."""
