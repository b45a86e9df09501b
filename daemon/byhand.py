"""A sample of the journal taken in hand: for the live page, for scripts and for notebooks.

hand = of_sample("S4", step="ml1")
hand.look(Choices(values={"glue1.thickness": 12e-6})).chi2_per_dof
result, there = hand.fit(Choices(free=("disk.c33D", "glue1.thickness"), effects=(("lead-inductance", "terminals"),)))
"""

from ..fitters.byhand import ByHand, Choices
from ..fitters.interface import FitResult, FitTask
from ..fitters.plugins import DEFAULT
from ..models.sweep import Sweep
from .archive import Archive, Measurement
from .client import fit_of
from .reported import UnknownSampleError
from .samples import open_journal
from .wire import FitEvent, decode

__all__ = ["ByHand", "Choices", "of_measurement", "of_sample"]


def of_sample(name: str, step: str | None = None) -> ByHand:
    """Return the latest measurement of a sample's step in hand, with the steps before it; None: the latest step.

    Handles begin where the latest fit ended. Raises UnknownSampleError, NoSamplesError, JournalError, FitError.
    """
    archive = open_journal()
    try:
        found = archive.measurements("sample = ? AND state = 'measured'", name)
        chosen = [one for one in found if step in (None, one.sample.step)]
        if not chosen:
            there = ", ".join(dict.fromkeys(one.sample.step for one in found)) or "none"
            raise UnknownSampleError(f"sample {name!r}: step {step!r} was not measured; measured: {there}")
        return _in_hand(archive, chosen[-1])
    finally:
        archive.close()


def of_measurement(measurement: str) -> ByHand:
    """Return one measurement in hand, be it still running, with the latest of each step before it.

    Raises UnknownSampleError, NoSamplesError, JournalError, FitError.
    """
    archive = open_journal()
    try:
        one = archive.measurement(measurement)
        if one is None:
            raise UnknownSampleError(f"the journal holds no measurement {measurement!r}")
        return _in_hand(archive, one)
    finally:
        archive.close()


def _in_hand(archive: Archive, one: Measurement) -> ByHand:
    build = archive.build(one.id)
    names = [step.name for step in build.steps]
    sweeps: dict[str, tuple[Sweep, ...]] = {}
    result: FitResult | None = None
    for step in names[: names.index(one.sample.step) + 1]:
        found = one.id if step == one.sample.step else archive.latest(one.sample.name, step, one.id)
        if found is not None:
            sweeps[step] = tuple(decode(event).sweep() for event in archive.sweeps(found))
            result = _fit(archive, found) or result
    task = FitTask(build, sweeps)
    return ByHand.after(task, result) if result is not None else ByHand(task)


def _fit(archive: Archive, measurement: str) -> FitResult | None:
    """Return the latest fit of the stack to a measurement."""
    for frames in reversed(archive.fits(measurement)):
        heard = decode(frames)
        if isinstance(heard.event, FitEvent) and heard.event.fitter == DEFAULT and heard.event.report is not None:
            return fit_of(heard)
    return None
