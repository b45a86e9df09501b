"""Concealed sets: recordings of devices with physics left out of their build, and their sealed truth.

An independent world. Nothing here is shared with the models that the fitters use: waves by power series of slices and a
boundary system, distributions by adding up areas, circuits by nodal analysis, sweeps by stepping through time, finite
disks by a Ritz solution in both dimensions.
"""
