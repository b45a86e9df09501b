"""What can be hidden on the bench by its name in the catalogue of left-out physics: at the terminals, or in the device.

`pzctl sim --hidden lead-inductance=2e-8`, or on the bench's port `{"command": "hidden", "lead-inductance": 2e-8}`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from .bench import Bench
from .bench_errors import BenchError


@dataclass(frozen=True)
class Kind:
    """One thing that can be hidden: whose field it is, in which unit, and below what it makes no sense."""

    whose: Literal["jig", "effects"]
    field: str
    unit: str
    least: float = 0.0


KINDS: Mapping[str, Kind] = {
    "lead-inductance": Kind("jig", "inductance", "H"),
    "series-resistance": Kind("jig", "resistance", "ohm"),
    "stray-capacitance": Kind("jig", "capacitance", "F"),
    "leakage": Kind("jig", "conductance", "S"),
    "drive-nonlinearity": Kind("effects", "strain_softening", "1/strain"),
    "sweep-lag": Kind("effects", "lag_s", "s"),
    "temperature-drift": Kind("effects", "drift_K_per_s", "K/s", least=-100.0),
}
"""By the catalogue's names. Those of the jig take the place of what the jig has of the same."""


def hide(bench: Bench, sizes: Mapping[str, object]) -> None:
    """Hide each of `sizes` (SI) on the bench; 0 takes it away again. Raises BenchError, nothing being changed then."""
    checked = {name: _size(name, size) for name, size in sizes.items()}
    for name, size in checked.items():
        kind = KINDS[name]
        setattr(bench, kind.whose, replace(getattr(bench, kind.whose), **{kind.field: size}))


def _size(name: str, size: object) -> float:
    kind = KINDS.get(name)
    if kind is None:
        raise BenchError(f"bench: nothing called {name!r} can be hidden; there are {', '.join(KINDS)}")
    if isinstance(size, bool) or not isinstance(size, int | float) or not kind.least <= size < float("inf"):
        raise BenchError(f"bench: {name} is {size!r}; a number from {kind.least:g} on is needed, in {kind.unit}")
    return float(size)


def hidden(bench: Bench) -> dict[str, float]:
    """Return the size (SI) of everything that can be hidden, as it stands on the bench."""
    return {name: getattr(getattr(bench, kind.whose), kind.field) for name, kind in KINDS.items()}


def parse(wishes: list[str]) -> dict[str, float]:
    """Return the sizes that `NAME=VALUE` words ask for. Raises BenchError; what `hide` looks at is left to it."""
    sizes: dict[str, float] = {}
    for wish in wishes:
        name, _, value = wish.partition("=")
        try:
            sizes[name] = float(value)
        except ValueError:
            raise BenchError(f"--hidden {wish}: NAME=VALUE with a number is needed, as lead-inductance=2e-8") from None
    return sizes
