"""Candidate sweeps that an analyzer can make: another level, bandwidth, direction or band, or a repetition."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ....models.base.arrays import Frequencies, Impedances, Reals
from ....models.sweep import Sweep
from ....models.sweep_plan import Segment, SweepPlan

_LEVEL_STEP = 5.0
_DENSER = 3
"""A sweep over a wider band has this many times the points, so that no resonance falls between them."""
_OVERTONE = 3.3
"""Stop frequency, in stops of a sweep over the fundamental, that includes the third harmonic and some margin."""


class InstrumentLimits(Protocol):
    """Capabilities of an analyzer that planning needs."""

    @property
    def frequency_Hz(self) -> tuple[float, float]:
        """Lowest and highest frequency, Hz."""
        ...

    @property
    def oscillator_V(self) -> tuple[float, float]:
        """Lowest and highest level, V rms."""
        ...

    def highest_level_V(self, impedance: Impedances) -> float:
        """Return the highest level, V rms, at which a device of this impedance (N,) can be measured."""
        ...

    @property
    def bandwidths(self) -> tuple[int, ...]:
        """Bandwidth settings, from fast to precise."""
        ...

    @property
    def points_per_sweep(self) -> int:
        """Largest number of points in one sweep."""
        ...

    @property
    def noise(self) -> Callable[[SweepPlan, Frequencies, Impedances], Reals]:
        """Relative standard deviation of Re and Im of Z from point to point, shape (N,)."""
        ...

    def seconds(self, plan: SweepPlan) -> float:
        """Return the duration of a plan, s."""
        ...


@dataclass(frozen=True)
class Experiment:
    """One further sweep."""

    kind: str
    """`lower level`, `higher level`, `bandwidth`, `direction`, `repeat`, `wider band`, `finer band`."""
    says: str
    """Instruction as a clause: `sweep down instead of up`."""
    plan: SweepPlan


def experiments(sweeps: Sequence[Sweep], can: InstrumentLimits) -> tuple[Experiment, ...]:
    """Return the variations of the narrowest sweep among `sweeps` (all of one step) that the analyzer can make.

    Not those that are among `sweeps` already: once more, they would only average the noise.
    """
    sweep = min(sweeps, key=lambda one: float(one.frequency[-1] / one.frequency[0]))
    base = plan_of(sweep)
    found = [_other_bandwidth(base, can), _other_direction(base), _wider(base, can), _finer(base, sweep)]
    found += [Experiment("repeat", "repeat the sweep as it was", base), *_other_levels(base, sweep, can)]
    known = [plan_of(one) for one in sweeps]
    return tuple(one for one in found if one is not None and (one.kind == "repeat" or one.plan not in known))


def plan_of(sweep: Sweep) -> SweepPlan:
    """Return the plan of a sweep, taken from its settings; missing settings get their defaults."""
    said = sweep.settings
    f = sweep.frequency
    spacing = "log" if said.get("spacing") == "log" else "linear"
    usual = SweepPlan((Segment(float(f[0]), float(f[-1]), int(f.size), spacing),))
    names = ("bandwidth", "point_average", "sweep_average", "direction", "bias_V")
    given = {name: said[name] for name in names if said.get(name) is not None}
    level = {"oscillator_A": said["oscillator_A"]} if said.get("oscillator_A") else {}
    if said.get("oscillator_V"):
        level["oscillator_V"] = said["oscillator_V"]
    return replace(usual, **given, **level)


def settings_of(plan: SweepPlan) -> dict[str, Any]:
    """Return the settings that a sweep by this plan would record, as far as models depend on them."""
    return {
        "direction": plan.direction,
        "oscillator_V": None if plan.oscillator_A else plan.oscillator_V,
        "bandwidth": plan.bandwidth,
    }


def frequencies(plan: SweepPlan) -> Frequencies:
    """Return the frequencies of a plan with one segment, Hz, shape (N,)."""
    (segment,) = plan.segments
    space = np.geomspace if segment.spacing == "log" else np.linspace
    return np.asarray(space(segment.start_Hz, segment.stop_Hz, segment.points), np.float64)


def _other_levels(base: SweepPlan, sweep: Sweep, can: InstrumentLimits) -> list[Experiment]:
    if base.oscillator_A is not None:
        return []
    V = base.oscillator_V
    lowest, highest = can.oscillator_V[0], can.highest_level_V(sweep.impedance)
    made: list[Experiment] = []
    if lowest <= V / _LEVEL_STEP:
        low = round(V / _LEVEL_STEP, 4)
        made.append(
            Experiment("lower level", f"sweep at {low:g} V instead of {V:g} V", replace(base, oscillator_V=low))
        )
    if highest / 2 >= V:
        says = f"sweep at {highest:g} V instead of {V:g} V"
        made.append(Experiment("higher level", says, replace(base, oscillator_V=highest)))
    return made


def _other_bandwidth(base: SweepPlan, can: InstrumentLimits) -> Experiment:
    fast, slow = can.bandwidths[0], can.bandwidths[-1]
    other, word = (fast, "faster") if base.bandwidth == slow else (slow, "slower")
    says = f"sweep {word}, with bandwidth {other} instead of {base.bandwidth}"
    return Experiment("bandwidth", says, replace(base, bandwidth=other))


def _other_direction(base: SweepPlan) -> Experiment:
    other = "down" if base.direction == "up" else "up"
    return Experiment("direction", f"sweep {other} instead of {base.direction}", replace(base, direction=other))


def _wider(base: SweepPlan, can: InstrumentLimits) -> Experiment | None:
    (one,) = base.segments
    lowest, highest = can.frequency_Hz
    low, high = max(one.start_Hz / 2, lowest), min(_OVERTONE * one.stop_Hz, highest)
    if high <= one.stop_Hz:
        return None
    return _over(base, "wider band", low, high, max(one.points, min(can.points_per_sweep, _DENSER * one.points)))


def _finer(base: SweepPlan, sweep: Sweep) -> Experiment | None:
    """Return a sweep with as many points around the strongest resonance and its antiresonance."""
    (one,) = base.segments
    G, R = (1 / sweep.impedance).real / sweep.frequency, sweep.impedance.real * sweep.frequency
    edges = sorted(float(sweep.frequency[int(np.argmax(part))]) for part in (G, R))
    width = max(edges[1] - edges[0], 0.02 * edges[0])
    low, high = max(edges[0] - width / 2, one.start_Hz), min(edges[1] + width / 2, one.stop_Hz)
    return _over(base, "finer band", low, high, one.points) if high - low < 0.5 * (one.stop_Hz - one.start_Hz) else None


def _over(base: SweepPlan, kind: str, low: float, high: float, points: int) -> Experiment:
    (one,) = base.segments
    low, high = float(f"{low:.4g}"), float(f"{high:.4g}")
    says = f"sweep from {low / 1e6:.4g} to {high / 1e6:.4g} MHz with {points} points"
    return Experiment(kind, says, replace(base, segments=(replace(one, start_Hz=low, stop_Hz=high, points=points),)))
