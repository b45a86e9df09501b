"""Validation: held-out data, whiteness of residuals, other samples."""
