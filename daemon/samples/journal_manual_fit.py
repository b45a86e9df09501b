"""Manual fits of samples in the journal, for the live page, scripts and notebooks.

hand = of_sample("S4", step="ml1")
hand.look(Choices(values={"glue1.thickness": 12e-6})).chi2_per_dof
result, there = hand.fit(Choices(free=("disk.c33D", "glue1.thickness"), effects=(("lead-inductance", "terminals"),)))
hand.keep(there, by="ana")          # fit again and write the result into the journal with her name
of_sample("D7", fitter="disk")      # a bare round disk, with the model of `disk` or of `radial`
"""

import hashlib
from dataclasses import replace

import msgspec

from ...fitters.interface import FitResult, FitTask
from ...fitters.manual.manual_fit import Choices, ManualFit
from ...fitters.plugins import DEFAULT
from ...fitters.polarity import put_right
from ...models.base.errors import PzctlError
from ...models.base.names import LONGEST_NAME, NameFault, check_name
from ...models.sweep import Sweep
from ..client.result_waiter import fit_of
from ..files.paths import home
from ..journal.journal_reader import JournalMeasurement, JournalReader
from ..wire.events import FitEvent, decode
from ..wire.frames import to_json
from .result_writer import keeping
from .sample_record import UnknownSampleError
from .sample_selection import open_journal

__all__ = ["Choices", "JournalManualFit", "ManualFit", "NobodyError", "of_measurement", "of_sample"]

_FEW = 6
"""Greatest number of constants that a sentence lists by name."""


class NobodyError(PzctlError):
    """A manual fit cannot be kept without the name of the person who made it."""


class JournalManualFit(ManualFit):
    """A manual fit of a measurement in the journal."""

    measurement = ""
    """The measurement's id."""

    def keep(self, choices: Choices, by: str) -> tuple[FitResult, Choices]:
        """Fit with exactly these choices and write the result into the journal, with the choices and the person's name.

        Return what `fit` returns. Keeping the same fit by the same person twice adds it only once. Raises NobodyError
        if `by` is not a name, FitError, DaemonError, JournalError.
        """
        who = " ".join(by.split())
        try:
            check_name(who, "by")
        except NameFault:
            says = f"by: {by!r} is no name; give the name of the person who made the fit, 1 to {LONGEST_NAME} letters"
            raise NobodyError(says) from None
        result, there = self.fit(choices)
        result = _signed(result, choices, who, self.fitter)
        sweeps = tuple(sweep.id for step in result.steps for sweep in self.sweeps[step])
        with keeping(home()) as put:
            put(self.measurement, sweeps, result)
        return result, there


def _signed(result: FitResult, choices: Choices, by: str, model: str) -> FitResult:
    """Return the result with the person and the choices added; its version depends on both."""
    free = [name for name, constant in result.constants.items() if constant.free]
    moved = ", ".join(free) if len(free) <= _FEW else f"{len(free)} constants"
    chosen = {"by": by, "model": model, **msgspec.to_builtins(choices)}
    mark = hashlib.sha256(to_json(chosen)).hexdigest()[:12]
    of = f", on the model of {model}" if model != DEFAULT else ""
    says = f"fitted by hand, by {by}{of}; free: {moved}"
    bands = [
        f"{step} {', '.join(f'{low / 1e6:g} to {high / 1e6:g} MHz' for low, high in of_step) or 'left out'}"
        for step, of_step in choices.bands.items()
    ]
    says += f"; bands: {', '.join(bands)}" if bands else ""
    effects = [f"{name} at {where}" for name, where in choices.effects]
    says += f"; with {', '.join(effects)}" if effects else ""
    return replace(result, version=f"{result.version}+{mark}", says=(f"{says}.", *result.says), chosen=chosen)


def of_sample(name: str, step: str | None = None, fitter: str = DEFAULT) -> JournalManualFit:
    """Return a manual fit of the latest measurement of a sample's step (None: the latest step) and the steps before.

    `fitter` names the model: `mason`, or for a bare round disk `radial` or `disk`. The adjustable constants start from
    its latest fit, or else from nominal values or the peaks of the recording.

    Raises UnknownSampleError, NoSamplesError, JournalError, FitError.
    """
    journal = open_journal()
    try:
        measured = journal.measurements("sample = ? AND state = 'measured'", name)
        chosen = [measurement for measurement in measured if step in (None, measurement.sample.step)]
        if not chosen:
            steps = ", ".join(dict.fromkeys(measurement.sample.step for measurement in measured)) or "none"
            missing = f"step {step!r} was not measured" if step else "it was not measured"
            raise UnknownSampleError(f"sample {name!r}: {missing}; measured: {steps}")
        return _manual_fit(journal, chosen[-1], fitter)
    finally:
        journal.close()


def of_measurement(measurement: str, fitter: str = DEFAULT) -> JournalManualFit:
    """Return a manual fit of one measurement, which may still run, with the latest one of each step before it.

    `fitter` as in `of_sample`. Raises UnknownSampleError, NoSamplesError, JournalError, FitError.
    """
    journal = open_journal()
    try:
        record = journal.measurement(measurement)
        if record is None:
            raise UnknownSampleError(f"the journal holds no measurement {measurement!r}")
        return _manual_fit(journal, record, fitter)
    finally:
        journal.close()


def _manual_fit(journal: JournalReader, measurement: JournalMeasurement, fitter: str) -> JournalManualFit:
    build = journal.build(measurement.id)
    last = measurement.sample.step
    names = [step.name for step in build.steps]
    # All models but the default one describe the bare disk, which is a single step.
    names = names[: names.index(last) + 1] if fitter == DEFAULT else [last]
    sweeps: dict[str, tuple[Sweep, ...]] = {}
    result: FitResult | None = None
    for step in names:
        of_step = measurement.id if step == last else journal.latest(measurement.sample.name, step, measurement.id)
        if of_step is not None:
            sweeps[step] = tuple(decode(event).sweep() for event in journal.sweeps(of_step))
            result = _fit(journal, of_step, fitter) or result
    right, _ = put_right(sweeps)  # as the fit did that it begins with
    task = FitTask(build, right)
    manual_fit = JournalManualFit.after(task, result) if result is not None else JournalManualFit(task, fitter)
    manual_fit.measurement = measurement.id
    return manual_fit


def _fit(journal: JournalReader, measurement: str, fitter: str) -> FitResult | None:
    """Return a fitter's latest fit of a measurement."""
    for frames in reversed(journal.fits(measurement)):
        answer = decode(frames)
        if isinstance(answer.event, FitEvent) and answer.event.fitter == fitter and answer.event.report is not None:
            return fit_of(answer)
    return None
