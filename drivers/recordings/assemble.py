"""Making a `Sweep` from the numbers of a file, with checks of order, units and polarity for every format."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.base.arrays import Impedances, Reals
from ...models.sweep import PER_POINT, Sweep
from .provenance import per_point_fault
from .text_file import TextFile, file_time

LOWEST_Hz = 40.0
"""Lowest frequency of the 4294A; a recording that ends below it has its frequencies in another unit."""
HIGHEST_Hz = 1e11
"""Frequency far above the range of any impedance analyzer."""
SMALLEST_OHM, LARGEST_OHM = 1e-30, 1e30
"""Sizes of Z far beyond any device; fits could not calculate with smaller or larger numbers."""

REFERENCE = 50.0
"""Usual reference of a network analyzer, ohm."""
REFLECTION_ACCURACY = 0.01
"""Accuracy of the reflection coefficient of a network analyzer after calibration; data sheets have 0.005 to 0.02."""

_OF_REFLECTION = (
    f"A network analyzer's accuracy is assumed, {100 * REFLECTION_ACCURACY:g} % of full reflection; "
    "--accuracy states another."
)


@dataclass(frozen=True, eq=False)
class Points:
    """The points of a file in the order of the file."""

    lines: Sequence[int]
    """The line of each point, shape (N,)."""
    frequency: Reals
    """Hz, shape (N,)."""
    impedance: Impedances
    """ohm, shape (N,)."""


def assemble(
    page: TextFile,
    points: Points,
    settings: Mapping[str, Any],
    time: str | None = None,
    id_: str | None = None,
    notes: Sequence[str] = (),
    *,
    reference: float | None = None,
) -> Sweep:
    """Return the recording. `time` None means the time of the file, `id_` None the name of the file.

    `reference`: in ohm, if the file is that of a network analyzer, which measures the reflection; the settings then
    have the accuracy at each point. A downward sweep is reversed. Inverted polarity is reported in the notes, and the
    numbers stay as recorded. Raises RecordingError for fewer than two points, for frequencies that are not monotonic,
    repeated or in another unit, for impedances that are zero or not finite, and for settings per point whose number is
    another one than that of the points.
    """
    lines, frequency, impedance = points.lines, points.frequency, points.impedance
    if frequency.size < 2:
        found = "one point" if frequency.size else "no points"
        raise page.error(None, f"{found} found; at least 2 are needed")
    settings = dict(settings)
    if fault := per_point_fault(settings, frequency.size):
        raise page.error(None, fault)
    if np.all(np.diff(frequency) < 0):
        frequency, impedance, lines = frequency[::-1], impedance[::-1], lines[::-1]
        settings |= {name: settings[name][::-1] for name in PER_POINT if settings.get(name)}
        settings["direction"] = "down"
    _check_frequency(page, lines, frequency)
    _check_impedance(page, lines, impedance)
    if reference is not None:
        settings["accuracy_relative"] = reflection_accuracy(impedance, reference).tolist()
        notes = (*notes, _OF_REFLECTION)
    return Sweep(
        frequency=frequency,
        impedance=impedance,
        settings=settings,
        time=file_time(page.path) if time is None else time,
        id=page.path.name if id_ is None else id_,
        notes=tuple(dict.fromkeys((*notes, *_polarity(impedance)))),
    )


def reflection_accuracy(Z: Impedances, reference: float) -> Reals:
    """Return the accuracy of ln Z from that of the reflection (Z - R)/(Z + R), shape (N,); R: the reference, ohm."""
    return np.asarray(REFLECTION_ACCURACY * np.abs(Z + reference) ** 2 / (2 * reference * np.abs(Z)), np.float64)


def _check_frequency(page: TextFile, lines: Sequence[int], f: Reals) -> None:
    bad = np.flatnonzero(~np.isfinite(f) | (f <= 0))
    if bad.size:
        k = int(bad[0])
        raise page.error(lines[k], f"the frequency is {f[k]:g} Hz; a positive one is needed")
    if f.max() < LOWEST_Hz:
        raise page.error(
            lines[0],
            f"frequencies end at {f.max():g} Hz, but analyzers measure from {LOWEST_Hz:g} Hz upwards; if they are "
            "in MHz, call the column frequency_MHz",
        )
    if f.max() > HIGHEST_Hz:
        raise page.error(
            lines[int(f.argmax())],
            f"the frequency is {f.max():g} Hz, beyond any analyzer ({HIGHEST_Hz:g} Hz); is its unit right?",
        )
    falls = np.flatnonzero(np.diff(f) <= 0)
    if falls.size:
        k = int(falls[0])
        word = "repeats" if f[k + 1] == f[k] else "is below"
        raise page.error(
            lines[k + 1],
            f"the frequency {f[k + 1]:.12g} Hz {word} that of line {lines[k]} ({f[k]:.12g} Hz); frequencies must rise "
            "(or fall) throughout",
        )


def _check_impedance(page: TextFile, lines: Sequence[int], z: Impedances) -> None:
    bad = np.flatnonzero(~np.isfinite(z) | (z == 0))
    if bad.size:
        k = int(bad[0])
        found = "an impedance of 0 ohm, which no device has" if z[k] == 0 else "no finite impedance"
        raise page.error(lines[k], f"these numbers give {found}")
    size = np.hypot(z.real, z.imag)
    far = np.flatnonzero((size < SMALLEST_OHM) | (size > LARGEST_OHM))
    if far.size:
        k = int(far[0])
        raise page.error(
            lines[k],
            f"these numbers give |Z| = {size[k]:.3g} ohm, which no device has; {SMALLEST_OHM:g} to {LARGEST_OHM:g} ohm "
            "are allowed",
        )


def _polarity(z: Impedances) -> list[str]:
    """Return a note if the real part is negative at most points, which is impossible for a passive device."""
    negative = int(np.count_nonzero(z.real < 0))
    if 2 * negative <= z.size:
        return []
    return [
        f"Re Z is negative at {negative} of {z.size} points: the recording is inverted by 180 degrees; the numbers "
        "stay as recorded."
    ]
