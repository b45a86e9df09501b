"""Uncertainties of a fit, their contributions, and the complete result."""
