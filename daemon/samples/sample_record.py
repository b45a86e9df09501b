"""What the journal knows of one sample: the latest measurement of each gluing step, and what was answered to it."""

from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from ...fitters.interface import Curve, FitResult
from ...models.base.errors import PzctlError
from ...models.build import Build
from ...models.sweep import Sweep
from ..client.result_waiter import fit_of
from ..journal.journal_reader import JournalMeasurement, JournalReader
from ..journal.withdrawal import WITHDRAWN, Withdrawal, withdrawal_of
from ..wire.events import DiagnosisEvent, FitEvent, SweepEvent, decode
from ..wire.result_messages import curves_of


class UnknownSampleError(PzctlError):
    """The journal holds no such sample, and no such measurement."""


@dataclass(frozen=True, eq=False)
class StepRecord:
    """One measurement of one gluing step, and what was answered to it."""

    measurement: JournalMeasurement
    sweeps: tuple[Sweep, ...]
    idn: str
    """Who measured, as `*IDN?` said."""
    fits: tuple[FitResult, ...]
    """The latest result of each fitter."""
    refusals: tuple[str, ...]
    """Why a fitter gave none, a sentence each."""
    diagnosis: DiagnosisEvent | None
    """The latest; its `diagnosis` is the object of `pzctl diagnose --json`."""
    diagnosis_curves: tuple[Curve, ...]
    """Of its picture; none where it came without."""
    withdrawal: Withdrawal | None = None
    """Who withdrew the measurement; then it was asked for by its id."""


@dataclass(frozen=True, eq=False)
class SampleRecord:
    """One sample as it is known now."""

    name: str
    build: Build
    """That of the newest measurement."""
    steps: tuple[StepRecord, ...]
    """In the order in which they were measured."""
    withdrawn: tuple[str, ...] = ()
    """A sentence for each measurement of the sample that was withdrawn."""


def sample_record(archive: JournalReader, asked: str) -> SampleRecord:
    """Return what is known of a sample, or of the one measurement with this id.

    Raises UnknownSampleError, JournalError.
    """
    one = archive.measurement(asked)
    found = [one] if one is not None else archive.measurements("sample = ? AND state = 'measured'", asked)
    name = found[-1].sample.name if found else asked
    withdrawn = tuple(_withdrawn(archive, name))
    if not found and withdrawn:
        raise UnknownSampleError(f"sample {asked!r}: no measurement of it counts: {'; '.join(withdrawn)}")
    if not found:
        raise UnknownSampleError(_unknown(archive, asked))
    latest: dict[str, JournalMeasurement] = {}
    for measurement in found:
        latest.pop(measurement.sample.step, None)
        latest[measurement.sample.step] = measurement
    build = archive.build(found[-1].id)
    order = {step.name: k for k, step in enumerate(build.steps)}
    steps = sorted(latest.values(), key=lambda m: order.get(m.sample.step, -1))
    return SampleRecord(name, build, tuple(_step(archive, measurement) for measurement in steps), withdrawn)


def step_sweeps(archive: JournalReader, sample: str, step: str | None) -> list[Sweep]:
    """Return every sweep of a sample's step, the oldest first; of the step last measured where none is named.

    Raises UnknownSampleError.
    """
    found = archive.measurements("sample = ? AND state = 'measured'", sample)
    if not found:
        raise UnknownSampleError(_unknown(archive, sample))
    steps = list(dict.fromkeys(one.sample.step for one in found))
    wanted = step or found[-1].sample.step
    if wanted not in steps:
        raise UnknownSampleError(f"sample {sample!r}: step {wanted!r} was not measured; measured: {', '.join(steps)}")
    of_step = [one for one in found if one.sample.step == wanted]
    return [decode(frames).sweep() for one in of_step for frames in archive.sweeps(one.id)]


def _withdrawn(archive: JournalReader, name: str) -> Iterator[str]:
    """Yield a sentence for each measurement of a sample that was withdrawn."""
    for one in archive.measurements("sample = ? AND state = ?", name, WITHDRAWN):
        found = withdrawal_of(archive, one.id)
        if found is not None:
            when = one.time[:16].replace("T", " ")
            yield f"step {one.sample.step} of {when} UTC ({one.id}) was {found.says}"


def _unknown(archive: JournalReader, asked: str) -> str:
    names = list(dict.fromkeys(one.sample.name for one in archive.measurements("state = 'measured'")))
    close = get_close_matches(asked, names, n=1)
    if close:
        return f"sample {asked!r}: the journal holds none; did you mean {close[0]!r}?"
    some = ", ".join(names[-8:]) or "no complete measurement"
    return f"sample {asked!r}: the journal holds no sample and no measurement of that name; it holds {some}"


def _step(archive: JournalReader, one: JournalMeasurement) -> StepRecord:
    heard = [decode(frames) for frames in archive.sweeps(one.id)]
    fits: dict[str, FitResult] = {}
    refusals: dict[str, str] = {}
    diagnosis: DiagnosisEvent | None = None
    curves: tuple[Curve, ...] = ()
    for answer in map(decode, archive.fits(one.id)):
        event = answer.event
        if isinstance(event, DiagnosisEvent):
            diagnosis, curves = event, curves_of(event.curves, answer.arrays)
        elif isinstance(event, FitEvent) and event.report is not None:
            fits[event.fitter] = fit_of(answer)
        elif isinstance(event, FitEvent):
            refusals[event.fitter] = event.error or "no reason was given"
    idn = next((h.event.instrument.idn for h in heard if isinstance(h.event, SweepEvent)), "")
    sentences = tuple(f"{name}: {why}" for name, why in refusals.items() if name not in fits)
    withdrawal = withdrawal_of(archive, one.id) if one.state == WITHDRAWN else None
    recorded = tuple(h.sweep() for h in heard)
    return StepRecord(one, recorded, idn, tuple(fits.values()), sentences, diagnosis, curves, withdrawal)
