"""The fitter of the disk in two dimensions, with all ten constants."""
