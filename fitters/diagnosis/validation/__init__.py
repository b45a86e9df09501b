"""Held-out data, whiteness of residuals, other samples."""
