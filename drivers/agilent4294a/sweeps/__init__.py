"""Sweeps of the 4294A: grids, single and list sweeps, and the recordings they become."""
