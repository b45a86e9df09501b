"""The virtual bench: the content of the fixture, and what the bridge of the analyzer measures of it.

The instrument calls `measure` for a sweep; the commands of the bench change what is measured. The two never mix:
no command of the instrument glues a layer.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Complexes, Impedances, Reals
from ..instrument.accuracy import noise_sigma, noisy, systematic, terms
from ..instrument.axis import Axis
from .bench_errors import BenchError
from .jig import JIGS, LOAD_STANDARD_OHM, Jig
from .sample import BenchSample
from .sample import sample as transducer
from .sweep_effects import Effects, device_impedance

CONTENTS = ("device", "open", "short", "load")
"""The possible contents of the fixture."""


@dataclass
class Bench:
    """The device under test, the jig, and the world around them."""

    seed: int = 0
    noise: bool = True
    """Random noise of section 8.3."""
    radial: bool = False
    """Whether the disk has radial modes, which a 1-D thickness model does not have."""
    off: bool = False
    """Systematic error of section 8.2, the same for every sweep of this instrument."""
    jig: Jig = field(default_factory=lambda: JIGS["compensated"])
    effects: Effects = field(default_factory=Effects)
    draw: Callable[[int], BenchSample] = transducer
    """Draws the sample of a seed."""
    step: str = field(init=False)
    content: str = field(init=False, default=CONTENTS[0])
    seconds: float = field(init=False, default=0.0)
    """Bench time: the unscaled duration of all sweeps so far."""
    inverted: bool = False
    """Fault: polarity reversed, the impedance comes with the opposite sign."""
    sample: BenchSample = field(init=False)
    _random: np.random.Generator = field(init=False)
    _idle_random: np.random.Generator = field(init=False)
    _latest: tuple[object, Impedances] | None = field(init=False, default=None)
    """The inputs of the device's last sweep and its impedance, cached because most sweeps of CONT are identical."""

    def __post_init__(self) -> None:
        self.new_sample(self.seed)
        self.check(self.effects, self.radial)

    def check(self, effects: Effects, radial: bool) -> None:
        """Raise BenchError if the sample cannot have these effects or radial modes."""
        if radial and self.sample.radial is None:
            raise BenchError("bench: this sample has no radial modes; only the bench's own transducer has them")
        if effects.strain_softening and len(self.sample.piezos) > 1:
            several = ", ".join(self.sample.piezos)
            raise BenchError(f"bench: drive-nonlinearity needs a single piezo layer; this sample has {several}")

    def new_sample(self, seed: int) -> None:
        """Put another bare disk into the fixture."""
        drawn = self.draw(seed)
        self.seed, self.sample, self.step, self.content = seed, drawn, drawn.steps[0], "device"
        self._random, self._idle_random = (np.random.default_rng([seed, stream]) for stream in (0, 1))

    def glue(self, step: str) -> None:
        """Glue the device up to a step. Raises BenchError for a step that does not exist or that is already passed."""
        self.sample.names(step)
        order = self.sample.steps
        if order.index(step) < order.index(self.step):
            raise BenchError(
                f"bench: the device is at step {self.step!r} and glue does not come off, so {step!r} is over; "
                "the bench's command new-sample puts in another bare disk"
            )
        self.step, self.content = step, "device"

    def glue_next(self) -> None:
        """Do the next gluing step. Raises BenchError after the last one."""
        steps = self.sample.steps
        following = steps.index(self.step) + 1
        if following == len(steps):
            raise BenchError(f"bench: {self.step!r} is the last gluing step; new-sample brings a bare disk")
        self.glue(steps[following])

    def connect(self, content: str) -> None:
        """Put the device, or a standard, into the fixture. Raises BenchError."""
        if content not in CONTENTS:
            raise BenchError(f"bench: cannot connect {content!r}; there are {', '.join(CONTENTS)}")
        self.content = content

    def measure(self, axis: Axis, point_seconds: Reals, reverse: bool, idle: bool = False) -> Impedances:
        """Return one sweep as the bridge measures it, shape (N,), points in the order of the axis; bench time advances.

        `point_seconds`, shape (N,), is how long each point takes; `reverse` sweeps from the last point to the first.
        An `idle` sweep is one of CONT. Their number depends on when clients connect, so they take no bench time and
        have a separate noise stream: the sweeps after them are the same on every run.
        """
        order = np.arange(axis.values.size, dtype=np.intp)[:: -1 if reverse else 1]
        when = np.empty_like(point_seconds)
        when[order] = self.seconds + np.cumsum(point_seconds[order])
        z = self._true(axis, when, point_seconds, order)
        if not idle:
            self.seconds += float(point_seconds.sum())
        return self._as_read(z, axis, self._idle_random if idle else self._random)

    def _true(self, axis: Axis, when: Reals, point_seconds: Reals, order: NDArray[np.intp]) -> Impedances:
        if self.content == "short":
            return self.jig.short(axis.frequency)
        return self.jig.through(axis.frequency, self._admittance(axis, when, point_seconds, order))

    def _admittance(self, axis: Axis, when: Reals, point_seconds: Reals, order: NDArray[np.intp]) -> Complexes:
        if self.content == "open":
            return np.zeros(axis.values.size, dtype=np.complex128)
        if self.content == "load":
            return np.full(axis.values.size, 1 / LOAD_STANDARD_OHM, dtype=np.complex128)
        arrays = tuple(array.tobytes() for array in (axis.frequency, axis.level, when, point_seconds, order))
        asked = (self.sample, self.step, self.radial, self.effects, arrays)
        if self._latest is None or self._latest[0] != asked:
            device = self.sample.device(self.step, self.radial)
            self._latest = asked, device_impedance(device, self.effects, axis, when, point_seconds, order)
        return 1 / self._latest[1]

    def _as_read(self, z: Impedances, axis: Axis, random: np.random.Generator) -> Impedances:
        level = np.where(axis.level > 0, axis.level, 1e-3)
        if self.off:
            z = systematic(z, terms(axis.frequency, axis.bandwidth, level), self._instrument_error())
        if self.noise:
            sigma = noise_sigma(z, axis.frequency, axis.bandwidth, level, axis.point_average)
            z = noisy(z, sigma, random)
        return -z if self.inverted else z

    def _instrument_error(self) -> Complexes:
        """Return the error of this instrument as fractions of its accuracy, shape (3,): set by the seed, at most 1."""
        random = np.random.default_rng([self.seed, 82])
        angle = 2 * np.pi * random.uniform(0, 1, 3)
        return random.uniform(0.2, 0.9, 3) * (np.cos(angle) + 1j * np.sin(angle))
