"""Antisymmetric motion of a disk whose faces are not alike: one electrode is thicker, one side deader.

What is on the front less what is on the back acts between the motion that a volt causes, u_r even in z, and the other
one. With W the mean of both faces and D half of their difference, H of half the disk is that of the even motion with W
and of the odd one with W, and D between them. The odd motion answers to the even one; what that gives back to the even
motion is of the fourth order in D for H, and is counted only where derivatives are taken.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from ..base.arrays import Complexes
from .band import Band, BandModes, band_shapes
from .coat import FaceWeights, face_forms
from .full import Shape
from .line_elements import Numbers
from .reduced import ReducedDisk


@dataclass(frozen=True, eq=False)
class OddMotion:
    """What the even motion of a band causes."""

    even: Band
    odd: Band
    difference: FaceWeights
    """Half of the front's weights less the back's."""
    cross: Numbers
    """`face_forms` between even and odd shapes, shape (11, m, mo)."""
    y: Complexes
    """For one volt, shape (N, mo)."""
    form: Complexes
    """What it adds to X H X, J/V2, shape (N,)."""

    @classmethod
    def of(
        cls,
        even: Band,
        y: Complexes,
        disk: ReducedDisk,
        modes: BandModes,
        shape: Shape,
        difference: FaceWeights,
    ) -> Self:
        """Return what an even motion, (N, m), causes in the odd shapes of this disk.

        `modes`: of the odd motion with the mean of both faces; `shape`: of the live ceramic.
        """
        f, few = even.frequency, [0, even.frequency.size // 2, even.frequency.size - 1]
        weights = difference.forces(f)
        pulled = difference.across(even.charge(y))
        # forces at both ends and in the middle: static shapes for them are part of the basis
        moved = face_forms(even.traces.mixed(y[few].T), disk.traces)
        loads = np.einsum("nk,knm->nm", weights[few], moved) + pulled[few] @ disk.charge_of(even.weights[few[1]])
        both = np.vstack([loads.real, loads.imag]).T
        basis = band_shapes(modes, float(f[0]), float(f[-1]), even.weights[few[1]], both)
        odd = Band.of(disk, basis, shape, f, even.weights, even.faces)
        cross = face_forms(even.traces, odd.traces)
        force = sum((weights[:, [k]] * (y @ one) for k, one in enumerate(cross)), odd.pulled(pulled))
        return cls(even, odd, difference, cross, *odd.answer(force))

    @cached_property
    def given_back(self) -> Complexes:
        """What the odd motion adds to the even one, shape (N, m)."""
        weights = self.difference.forces(self.even.frequency)
        pulled = self.difference.across(self.odd.charge(self.y))
        force = sum((weights[:, [k]] * (self.y @ one.T) for k, one in enumerate(self.cross)), self.even.pulled(pulled))
        return self.even.answer(force)[0]
