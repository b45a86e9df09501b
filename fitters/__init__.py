"""Estimation: parameters, objective, and the fitters that turn sweeps into complex constants."""
