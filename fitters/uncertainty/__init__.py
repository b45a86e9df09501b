"""Uncertainties of a fit, what determines them, and the result with all of it."""
