"""Blind cases: recordings of devices with effects that their build files omit, and the sealed truth about them.

The simulation is independent of the fitters' models and shares nothing with them: it computes waves by power series in
slices and a boundary system, distributions by adding up areas, circuits by nodal analysis, sweeps by stepping through
time, and finite disks by a Ritz solution in both dimensions.
"""
