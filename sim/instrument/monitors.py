"""The level monitors: oscillator level and bias at the device during a sweep (PM p.88, 365, 376, 380, 394)."""

from dataclasses import dataclass, field

import numpy as np

from ...models.base.arrays import Impedances, Reals
from .axis import Axis
from .state import State

SOURCE_OHM = 25.0
"""Resistance between oscillator and device [assumed: the manual does not give it]."""

HIGH_LEVEL_V, LOW_OHM = 0.5, 48.0
"""Above this level and below this impedance the instrument demands a lower level (error 134)."""


def _nothing() -> Reals:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class Monitors:
    """Readings at each point, shape (N,); empty where the monitor was off."""

    volts: Reals = field(default_factory=_nothing)
    amperes: Reals = field(default_factory=_nothing)
    bias: Reals = field(default_factory=_nothing)
    """V or A, as selected by BMON."""


def monitored(state: State, axis: Axis, z: Impedances) -> Monitors:
    """Return the readings of the active monitors during this sweep."""
    nothing = _nothing()
    volts = amperes = nothing
    if state.on("OMON"):
        source = axis.level if state["POWMOD"] == "VOLT" else axis.level * SOURCE_OHM
        amperes = source / np.abs(z + SOURCE_OHM)
        volts = amperes * np.abs(z)
    return Monitors(volts, amperes, _bias(state, axis) if state["BMON"] != "OFF" else nothing)


def _bias(state: State, axis: Axis) -> Reals:
    """Return the bias at the device; the device conducts no direct current."""
    if state["BMON"] == "CURR" or not state.on("DCO"):
        return np.zeros(axis.values.size)
    if state["SWPP"] == "DCB":
        return axis.values
    return np.full(axis.values.size, state.real("DCV"))


def needs_less_level(axis: Axis, z: Impedances, state: State) -> bool:
    """Return whether the bridge cannot balance at this level (error 134, PM p.498)."""
    return state["POWMOD"] == "VOLT" and bool(np.any((axis.level > HIGH_LEVEL_V) & (np.abs(z) < LOW_OHM)))
