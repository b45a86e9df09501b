"""A sample of the journal taken in hand: for the live page, for scripts and for notebooks.

hand = of_sample("S4", step="ml1")
hand.look(Choices(values={"glue1.thickness": 12e-6})).chi2_per_dof
result, there = hand.fit(Choices(free=("disk.c33D", "glue1.thickness"), effects=(("lead-inductance", "terminals"),)))
hand.keep(there, by="ana")          # fitted once more, and in the journal with her name
of_sample("D7", fitter="disk")      # a bare round disk, with the model of `disk` or of `radial`
"""

import hashlib
from dataclasses import replace

import msgspec

from ...fitters.interface import FitResult, FitTask
from ...fitters.manual.manual_fit import Choices, ManualFit
from ...fitters.plugins import DEFAULT
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
"""Constants that a sentence names one by one."""


class NobodyError(PzctlError):
    """A fit by hand that is to be kept, and nobody who made it."""


class JournalManualFit(ManualFit):
    """A measurement of the journal, taken in hand."""

    measurement = ""
    """Its id."""

    def keep(self, choices: Choices, by: str) -> tuple[FitResult, Choices]:
        """Fit with exactly these choices and write the result into the journal, with who made it and what was chosen.

        Return what `fit` returns. The same fit by the same person is in the journal once. Raises NobodyError where
        `by` names nobody, FitError, DaemonError, JournalError.
        """
        who = " ".join(by.split())
        try:
            check_name(who, "by")
        except NameFault:
            says = f"by: {by!r} names nobody; 1 to {LONGEST_NAME} letters say who made the fit"
            raise NobodyError(says) from None
        result, there = self.fit(choices)
        result = _signed(result, choices, who, self.fitter)
        sweeps = tuple(sweep.id for step in result.steps for sweep in self.sweeps[step])
        with keeping(home()) as put:
            put(self.measurement, sweeps, result)
        return result, there


def _signed(result: FitResult, choices: Choices, by: str, model: str) -> FitResult:
    """Return the result with its maker and the choices in it; its version tells it from a fit with other choices."""
    free = [name for name, one in result.constants.items() if one.free]
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
    """Return the latest measurement of a sample's step in hand, with the steps before it; None: the latest step.

    `fitter`: whose model, `mason`, or of a bare round disk `radial` or `disk`. Handles begin where its latest fit
    ended, and where it has not answered at nominal values, or where the peaks of the recording are.

    Raises UnknownSampleError, NoSamplesError, JournalError, FitError.
    """
    archive = open_journal()
    try:
        found = archive.measurements("sample = ? AND state = 'measured'", name)
        chosen = [one for one in found if step in (None, one.sample.step)]
        if not chosen:
            there = ", ".join(dict.fromkeys(one.sample.step for one in found)) or "none"
            asked = f"step {step!r} was not measured" if step else "it was not measured"
            raise UnknownSampleError(f"sample {name!r}: {asked}; measured: {there}")
        return _in_hand(archive, chosen[-1], fitter)
    finally:
        archive.close()


def of_measurement(measurement: str, fitter: str = DEFAULT) -> JournalManualFit:
    """Return one measurement in hand, be it still running, with the latest of each step before it.

    `fitter` as in `of_sample`. Raises UnknownSampleError, NoSamplesError, JournalError, FitError.
    """
    archive = open_journal()
    try:
        one = archive.measurement(measurement)
        if one is None:
            raise UnknownSampleError(f"the journal holds no measurement {measurement!r}")
        return _in_hand(archive, one, fitter)
    finally:
        archive.close()


def _in_hand(archive: JournalReader, one: JournalMeasurement, fitter: str) -> JournalManualFit:
    build = archive.build(one.id)
    names = [step.name for step in build.steps]
    # The others' models are of one step alone: that of the bare disk.
    names = names[: names.index(one.sample.step) + 1] if fitter == DEFAULT else [one.sample.step]
    sweeps: dict[str, tuple[Sweep, ...]] = {}
    result: FitResult | None = None
    for step in names:
        found = one.id if step == one.sample.step else archive.latest(one.sample.name, step, one.id)
        if found is not None:
            sweeps[step] = tuple(decode(event).sweep() for event in archive.sweeps(found))
            result = _fit(archive, found, fitter) or result
    task = FitTask(build, sweeps)
    hand = JournalManualFit.after(task, result) if result is not None else JournalManualFit(task, fitter)
    hand.measurement = one.id
    return hand


def _fit(archive: JournalReader, measurement: str, fitter: str) -> FitResult | None:
    """Return a fitter's latest fit to a measurement."""
    for frames in reversed(archive.fits(measurement)):
        heard = decode(frames)
        if isinstance(heard.event, FitEvent) and heard.event.fitter == fitter and heard.event.report is not None:
            return fit_of(heard)
    return None
