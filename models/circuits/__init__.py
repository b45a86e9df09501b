"""Lumped circuits and what stands between analyzer and device."""
