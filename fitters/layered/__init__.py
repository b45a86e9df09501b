"""Fitters of the one-dimensional stack, and of devices of unknown structure."""
