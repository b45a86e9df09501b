"""Sweep plans with their points where the resonances are."""
