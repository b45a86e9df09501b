"""Hidden effects of the bench by their names in the catalogue of effects: at the terminals or in the device.

`pzctl sim --hidden lead-inductance=2e-8`, or on the bench's port `{"command": "hidden", "lead-inductance": 2e-8}`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from .bench import Bench
from .bench_errors import BenchError
from .json_numbers import finite, quoted


@dataclass(frozen=True)
class Kind:
    """One hidden effect: the field of the bench that holds its size, its unit and its smallest allowed size."""

    owner: Literal["jig", "effects"]
    field: str
    unit: str
    minimum: float = 0.0


KINDS: Mapping[str, Kind] = {
    "lead-inductance": Kind("jig", "inductance", "H"),
    "series-resistance": Kind("jig", "resistance", "ohm"),
    "stray-capacitance": Kind("jig", "capacitance", "F"),
    "leakage": Kind("jig", "conductance", "S"),
    "drive-nonlinearity": Kind("effects", "strain_softening", "1/strain"),
    "sweep-lag": Kind("effects", "lag_s", "s"),
    "temperature-drift": Kind("effects", "drift_K_per_s", "K/s", minimum=-100.0),
}
"""Hidden effects by name. Those at the terminals replace the same residual of the jig."""


def hide(bench: Bench, sizes: Mapping[str, object]) -> None:
    """Set the hidden effects to `sizes` (SI); 0 removes one. Raises BenchError and then changes nothing."""
    checked = {name: _size(name, size) for name, size in sizes.items()}
    inside = {KINDS[name].field: size for name, size in checked.items() if KINDS[name].owner == "effects"}
    bench.check(replace(bench.effects, **inside), bench.radial)
    for name, size in checked.items():
        kind = KINDS[name]
        setattr(bench, kind.owner, replace(getattr(bench, kind.owner), **{kind.field: size}))


def _size(name: str, size: object) -> float:
    kind = KINDS.get(name)
    if kind is None:
        raise BenchError(f"bench: nothing called {name!r} can be hidden; there are {', '.join(KINDS)}")
    number = finite(size)
    if number is None or number < kind.minimum:
        says = f"is {quoted(size)}; a number from {kind.minimum:g} on is needed, in {kind.unit}"
        raise BenchError(f"bench: {name} {says}")
    return number


def hidden(bench: Bench) -> dict[str, float]:
    """Return the present size (SI) of every hidden effect of the bench."""
    return {name: getattr(getattr(bench, kind.owner), kind.field) for name, kind in KINDS.items()}


def parse(options: list[str]) -> dict[str, float]:
    """Return the sizes by name in `NAME=VALUE` options. Raises BenchError; `hide` checks names and ranges."""
    sizes: dict[str, float] = {}
    for text in options:
        name, _, value = text.partition("=")
        try:
            sizes[name] = float(value)
        except ValueError:
            raise BenchError(f"--hidden {text}: NAME=VALUE with a number is needed, as lead-inductance=2e-8") from None
    return sizes
