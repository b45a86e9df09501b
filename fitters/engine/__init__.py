"""Least squares: recordings, noise, objective, descent, covariance."""
