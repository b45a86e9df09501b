"""The scale of the screen's Y axis: initial values depend on what the trace shows (PM p.273, 409, 423, 456)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from .settings import Number
from .trace_data import PHASES, quantity

if TYPE_CHECKING:
    from .instrument import Instrument

_OHM = {"TOPV": 1e6, "BOTV": 0.0, "REFV": 500e3, "SCAL": 100e3}
_SIEMENS = {"TOPV": 1.0, "BOTV": 0.0, "REFV": 0.5, "SCAL": 0.1}
_DEGREE = {"TOPV": 180.0, "BOTV": -180.0, "REFV": 0.0, "SCAL": 36.0}
_FARAD = {"TOPV": 1e-3, "BOTV": 0.0, "REFV": 500e-6, "SCAL": 100e-6}
_HENRY = {"TOPV": 10.0, "BOTV": 0.0, "REFV": 5.0, "SCAL": 1.0}
_QUALITY = {"TOPV": 1e3, "BOTV": 0.0, "REFV": 500.0, "SCAL": 100.0}
_PLANE = {"TOPV": 1e6, "BOTV": 0.0, "REFV": 1.0, "SCAL": 50.0}

INITIAL: Mapping[str, Mapping[str, float]] = {
    **dict.fromkeys(("|Z|", "R", "X", "Rp"), _OHM),
    **dict.fromkeys(("|Y|", "G", "B", "D"), _SIEMENS),
    **dict.fromkeys(PHASES, _DEGREE),
    **dict.fromkeys(("Cs", "Cp"), _FARAD),
    **dict.fromkeys(("Ls", "Lp"), _HENRY),
    "Q": _QUALITY,
    "complex": _PLANE,
}
"""Initial values by quantity, on linear axes."""

LOGARITHMIC_BOTTOM: Mapping[str, float] = {
    **dict.fromkeys(("|Z|", "R", "X", "Rp", "complex"), 1.0),
    **dict.fromkeys(PHASES, 100e-6),
    **dict.fromkeys(("|Y|", "G", "B", "D"), 1e-6),
    **dict.fromkeys(("Cs", "Cp"), 1e-9),
    **dict.fromkeys(("Ls", "Lp"), 10e-6),
    "Q": 1e-3,
}

LIMITS: Mapping[str, tuple[float, float]] = {
    "TOPV": (-1e12, 1e12),
    "BOTV": (-1e9, 1e9),
    "REFV": (-1e12, 1e12),
    "SCAL": (1e-15, 100e6),
    "REFP": (0.0, 10.0),
}

LEAST_GAP, LEAST_RATIO = 10e-15, 5.0
"""Smallest distance between top and bottom, on a linear and on a logarithmic axis."""


def get(instrument: "Instrument", name: str) -> float:
    """Return a value of the active trace's scale."""
    trace, what = str(instrument.state["TRAC"]), quantity(instrument)
    if name == "REFP":
        return instrument.scale.get((trace, what, name), 0.0 if what in ("|Z|", "|Y|") else 5.0)
    first = INITIAL[what][name]
    if name == "BOTV" and instrument.formats[trace] == "LOGY":
        first = LOGARITHMIC_BOTTOM[what]
    return instrument.scale.get((trace, what, name), first)


def put(instrument: "Instrument", name: str, argument: bytes) -> None:
    """Set a value of the active trace's scale; top and bottom push each other along. Raises CommandError."""
    kind = Number(*LIMITS[name], 0.0, "ANY", 1e-2 if name == "REFP" else 0.0)
    _keep(instrument, name, kind.parse(argument))
    if name not in ("TOPV", "BOTV"):
        return
    top, bottom = get(instrument, "TOPV"), get(instrument, "BOTV")
    other = "BOTV" if name == "TOPV" else "TOPV"
    if instrument.formats[str(instrument.state["TRAC"])] == "LOGY":
        if top < LEAST_RATIO * bottom:
            _keep(instrument, other, top / LEAST_RATIO if name == "TOPV" else bottom * LEAST_RATIO)
    elif top - bottom < LEAST_GAP:
        _keep(instrument, other, top - LEAST_GAP if name == "TOPV" else bottom + LEAST_GAP)


def fit(instrument: "Instrument", low: float, high: float) -> None:
    """AUTO: choose the scale of the active trace so that these values fit."""
    _keep(instrument, "TOPV", high if high > low else low + max(abs(low), 1.0) / 10)
    _keep(instrument, "BOTV", low)
    _keep(instrument, "REFV", (low + high) / 2)
    _keep(instrument, "SCAL", max((high - low) / 10, LIMITS["SCAL"][0]))


def _keep(instrument: "Instrument", name: str, value: float) -> None:
    instrument.scale[str(instrument.state["TRAC"]), quantity(instrument), name] = value
