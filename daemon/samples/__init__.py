"""Samples of the journal or of a folder, and results written back to the journal."""
