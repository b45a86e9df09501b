"""Blind cases: recordings of devices with effects that their build files omit, and the sealed truth about them.

This is an independent world that shares nothing with the models of the fitters: it computes waves by power series in
slices and a boundary system, distributions by adding up areas, circuits by nodal analysis, sweeps by stepping through
time, and finite disks by a Ritz solution in both dimensions.
"""
