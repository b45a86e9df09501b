"""The journal's record of one sample: the latest measurement of each gluing step, with its fits and diagnosis."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ...fitters.interface import Curve, FitResult
from ...models.base.errors import PzctlError
from ...models.base.names import likely_meant
from ...models.build import Build
from ...models.sweep import Sweep
from ..client.result_waiter import fit_of
from ..journal.journal_reader import JournalMeasurement, JournalReader
from ..journal.stores.event_rows import WITHDRAWN
from ..journal.withdrawal import Withdrawal, withdrawal_of
from ..wire.events import DiagnosisEvent, FitEvent, SweepEvent, decode
from ..wire.result_messages import curves_of


class UnknownSampleError(PzctlError):
    """The journal holds no such sample or measurement."""


@dataclass(frozen=True, eq=False)
class StepRecord:
    """One measurement of one gluing step, with its fits and diagnosis."""

    measurement: JournalMeasurement
    sweeps: tuple[Sweep, ...]
    idn: str
    """The analyzer's answer to `*IDN?`."""
    fits: tuple[FitResult, ...]
    """The latest result of each fitter."""
    refusals: tuple[str, ...]
    """One sentence for each fitter that refused."""
    diagnosis: DiagnosisEvent | None
    """The latest; its `diagnosis` is the object of `pzctl diagnose --json`."""
    diagnosis_curves: tuple[Curve, ...]
    """The curves of the diagnosis's picture; may be empty."""
    metadata: Mapping[str, str | float] = field(default_factory=dict[str, str | float])
    """What was noted at the measurement, with `mass_g` if the step was weighed."""
    deciding: tuple[Sweep, ...] = ()
    """The sweeps made to decide the diagnosis of the measurement; no fit takes them."""
    withdrawal: Withdrawal | None = None
    """The withdrawal of the measurement; only a request by its id returns a withdrawn one."""


@dataclass(frozen=True, eq=False)
class SampleRecord:
    """The current record of one sample."""

    name: str
    build: Build
    """The build of the newest measurement."""
    steps: tuple[StepRecord, ...]
    """In the order in which they were measured."""
    withdrawn: tuple[str, ...] = ()
    """One sentence for each withdrawn measurement of the sample."""
    measurement: str | None = None
    """The id of the only measurement that was asked for; None if the sample was."""


def sample_record(journal: JournalReader, name_or_id: str) -> SampleRecord:
    """Return the record of a sample, or of the one measurement with this id.

    Raises UnknownSampleError, JournalError.
    """
    by_id = journal.measurement(name_or_id)
    measured = [by_id] if by_id else journal.measurements("sample = ? AND state = 'measured'", name_or_id)
    name = measured[-1].sample.name if measured else name_or_id
    withdrawn = tuple(_withdrawn(journal, name))
    if not measured and withdrawn:
        raise UnknownSampleError(f"sample {name!r}: all its measurements were withdrawn: {'; '.join(withdrawn)}")
    if not measured:
        raise UnknownSampleError(_unknown(journal, name))
    latest: dict[str, JournalMeasurement] = {}
    for measurement in measured:
        latest.pop(measurement.sample.step, None)
        latest[measurement.sample.step] = measurement
    build = journal.build(measured[-1].id)
    order = {step.name: k for k, step in enumerate(build.steps)}
    steps = sorted(latest.values(), key=lambda m: order.get(m.sample.step, -1))
    records = tuple(_step(journal, measurement) for measurement in steps)
    return SampleRecord(name, build, records, withdrawn, by_id.id if by_id else None)


def step_sweeps(journal: JournalReader, sample: str, step: str | None) -> list[Sweep]:
    """Return every sweep of a sample's step, the oldest first; of the step last measured where none is named.

    Raises UnknownSampleError.
    """
    measured = journal.measurements("sample = ? AND state = 'measured'", sample)
    if not measured:
        raise UnknownSampleError(_unknown(journal, sample))
    steps = list(dict.fromkeys(measurement.sample.step for measurement in measured))
    wanted = step or measured[-1].sample.step
    if wanted not in steps:
        raise UnknownSampleError(f"sample {sample!r}: step {wanted!r} was not measured; measured: {', '.join(steps)}")
    of_step = [measurement for measurement in measured if measurement.sample.step == wanted]
    return [decode(frames).sweep() for measurement in of_step for frames in journal.sweeps(measurement.id)]


def _withdrawn(journal: JournalReader, name: str) -> Iterator[str]:
    """Yield one sentence for each withdrawn measurement of a sample."""
    for measurement in journal.measurements("sample = ? AND state = ?", name, WITHDRAWN):
        withdrawal = withdrawal_of(journal, measurement.id)
        if withdrawal is not None:
            when = measurement.time[:16].replace("T", " ")
            yield f"step {measurement.sample.step} of {when} UTC ({measurement.id}) was {withdrawal.says}"


def _unknown(journal: JournalReader, name: str) -> str:
    """Return the sentence about a name that the journal does not hold, with the names that it holds."""
    names = list(dict.fromkeys(measured.sample.name for measured in journal.measurements("state = 'measured'")))
    close = likely_meant(name, names)
    if close:
        return f"sample {name!r}: the journal holds none; did you mean {close[0]!r}?"
    some = ", ".join(names[-8:]) or "no complete measurement"
    return f"sample {name!r}: the journal holds no sample and no measurement of that name; it holds {some}"


def _step(journal: JournalReader, measurement: JournalMeasurement) -> StepRecord:
    events = [decode(frames) for frames in journal.sweeps(measurement.id)]
    fits: dict[str, FitResult] = {}
    refusals: dict[str, str] = {}
    diagnosis: DiagnosisEvent | None = None
    curves: tuple[Curve, ...] = ()
    for answer in map(decode, journal.fits(measurement.id)):
        event = answer.event
        if isinstance(event, DiagnosisEvent):
            diagnosis, curves = event, curves_of(event.curves, answer.arrays)
        elif isinstance(event, FitEvent) and event.report is not None:
            fits[event.fitter] = fit_of(answer)
        elif isinstance(event, FitEvent):
            refusals[event.fitter] = event.error or "no reason was given"
    idn = next((received.event.instrument.idn for received in events if isinstance(received.event, SweepEvent)), "")
    sentences = tuple(f"{name}: {why}" for name, why in refusals.items() if name not in fits)
    withdrawal = withdrawal_of(journal, measurement.id) if measurement.state == WITHDRAWN else None
    sweeps = tuple(received.sweep() for received in events)
    metadata = noted(journal, measurement)
    return StepRecord(
        measurement=measurement,
        sweeps=sweeps,
        idn=idn,
        fits=tuple(fits.values()),
        refusals=sentences,
        diagnosis=diagnosis,
        diagnosis_curves=curves,
        metadata=metadata,
        deciding=_deciding(journal, measurement),
        withdrawal=withdrawal,
    )


def _deciding(journal: JournalReader, measurement: JournalMeasurement) -> tuple[Sweep, ...]:
    """Return the sweeps that were made to decide the diagnosis of a measurement, the oldest first."""
    sample = measurement.sample
    aside = journal.measurements("sample = ? AND step = ? AND state = 'measured-aside'", sample.name, sample.step)
    events = [decode(frames) for one in aside for frames in journal.sweeps(one.id)]
    return tuple(
        received.sweep()
        for received in events
        if isinstance(received.event, SweepEvent) and received.event.decides == measurement.id
    )


def noted(journal: JournalReader, measurement: JournalMeasurement) -> dict[str, str | float]:
    """Return what was noted at a measurement, with `mass_g` and `mass_u_g` if its step was weighed."""
    build = journal.build(measurement.id)
    mass = next((step.mass for step in build.steps if step.name == measurement.sample.step), None)
    return {**build.metadata, **({} if mass is None else {"mass_g": 1e3 * mass.re, "mass_u_g": 1e3 * mass.u})}
