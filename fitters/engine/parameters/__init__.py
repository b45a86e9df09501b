"""Parameters of a fit: coordinates, bounds, priors, overrides."""
