"""The sections of a report, each as HTML, with every name and sentence from outside escaped."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from html import escape
from importlib.metadata import version
from typing import Any

from ....fitters.interface import FitResult
from ....fitters.population.conformity import judged
from ....models.base.uncertain_numbers import complex_with_uncertainty, with_uncertainty
from ....models.build import Build
from ....models.sweep import Sweep
from ...samples.sample_record import SampleRecord, StepRecord
from ...wire.frames import to_json
from ..constant_text import constant_text
from ..pictures import svg_pictures as draw
from ..tables.deviation import deviation
from ..tables.fit_tables import derived_shown
from ..tables.verdict_table import HEADS, verdict_row
from .diagnosis_section import diagnosis_section
from .html_table import table

_FEW = 8
"""Greatest number of values of one setting that are written out."""
_BAD, _GOOD = 2.0, 1.2
"""chi2/dof above which the model lacks an effect, and below which it lacks none."""


def measured(record: SampleRecord) -> str:
    """Return a table with one row for each sweep, then a sentence for each withdrawn measurement."""
    rows = [
        (
            record_of_step.measurement.sample.step,
            sweep.time[:19].replace("T", " "),
            _band(sweep),
            str(sweep.frequency.size),
            _drive(sweep.settings),
            str(sweep.settings.get("bandwidth", "")),
            "; ".join((*said, *sweep.notes)),
        )
        for record_of_step in record.steps
        for sweep, said in _sweeps(record_of_step)
    ]
    shown = table(("step", "begun (UTC)", "band", "points", "oscillator", "bandwidth", "notes"), rows)
    notes = [
        (step.measurement.sample.step, ", ".join(f"{key} {_in_short(value)}" for key, value in step.metadata.items()))
        for step in record.steps
        if step.metadata
    ]
    shown += table(("step", "noted"), notes) if notes else ""
    return shown + "".join(f"<p>{escape(says)}.</p>" for says in record.withdrawn)


def _band(sweep: Sweep) -> str:
    return f"{sweep.frequency[0] / 1e6:.4g} - {sweep.frequency[-1] / 1e6:.4g} MHz"


def _sweeps(record: StepRecord) -> Iterator[tuple[Sweep, tuple[str, ...]]]:
    """Yield every sweep of a step with what is to be said of it: its withdrawal, or that it decided the diagnosis."""
    withdrawn = (record.withdrawal.says,) if record.withdrawal else ()
    yield from ((sweep, withdrawn) for sweep in record.sweeps)
    yield from ((sweep, ("made to decide the diagnosis; not fitted",)) for sweep in record.deciding)


def _drive(settings: Any) -> str:
    for key, unit in (("oscillator_A", "A"), ("oscillator_V", "V")):
        if isinstance(settings.get(key), int | float):
            return f"{settings[key]:g} {unit}"
    return ""


def verdict(fit: FitResult, build: Build) -> str:
    """Return the verdict by the limits of the build, or an empty text if there are none."""
    sample = judged(fit, build)
    if sample is None:
        return ""
    rows = [verdict_row(one) for one in sample.limits]
    rule = (
        f"A constant passes if it keeps its limit with a probability of {sample.conformance:g} or more, and fails if "
        "it violates it with that probability (decision rule of ISO 14253-1); between the two, within the guard band, "
        "the measurement does not decide."
    )
    html = f"<p class='verdict'>{sample.verdict}</p><p>{rule}</p>"
    return html + table(HEADS, rows, [one.verdict for one in sample.limits])


def constants(fit: FitResult, build: Build) -> str:
    """Return the table of constants: fitted value, data sheet, deviation in joint standard uncertainties."""
    sheet = build.data_sheet
    rows: list[Sequence[str]] = []
    classes: list[str] = []
    for name, c in fit.constants.items():
        nominal = sheet.get(name)
        value = _unbroken(constant_text(name, c))
        expected = _number(nominal.re, nominal.im, nominal.u, nominal.u_im) if nominal else ""
        percent, classed = deviation(name, c, nominal)
        rows.append((name, value, c.unit, expected, percent, nominal.source if nominal else ""))
        classes.append(classed)
    for name, c in derived_shown(fit).items():
        rows.append((name, _unbroken(constant_text(name, c)), c.unit, "", "derived", ""))
        classes.append("held")
    return table(("constant", "fitted", "unit", "data sheet, build file", "deviation", "source"), rows, classes)


def _number(re: float, im: float, u_re: float | None, u_im: float | None) -> str:
    return _unbroken(complex_with_uncertainty(re, im, u_re, u_im))


def _unbroken(number: str) -> str:
    """Return a complex number as text that is not broken before its j."""
    return number.replace(" j", "\N{NO-BREAK SPACE}j")


def budget(fit: FitResult) -> str:
    """Return the contributions to each uncertainty, or a sentence if the fit has no budget."""
    if fit.budget is None:
        return f"<p>This fit by {escape(fit.fitter)} has no uncertainty budget.</p>"
    rows = [
        (
            f"{name}{suffix}",
            fit.constants[name].unit,
            *(_two_digits(part) for part in (s.noise, s.instrument, s.model, s.dimensions, s.knowledge, s.assumptions)),
            _most(s),
        )
        for suffix, shares in (("", fit.budget.re), (" (imaginary)", fit.budget.im))
        for name, s in shares.items()
        if name in fit.constants
    ]
    heads = (
        "constant",
        "unit",
        "noise",
        "instrument",
        "model",
        "dimensions",
        "data sheets",
        "held values, if off by their tolerance",
        "largest",
    )
    note = (
        "<p>Standard uncertainties in the unit of the constant. u is the root of the sum of squares of noise, "
        "instrument, model, dimensions and data sheets; it does not include the held values.</p>"
    )
    return note + table(heads, rows)


def _two_digits(value: float) -> str:
    return with_uncertainty(float(f"{value:.2g}"), None)


def _most(share: Any) -> str:
    return f"{share.largest[0]}: {_two_digits(share.largest[1])}"


def correlations(fit: FitResult) -> str:
    """Return the pairs of constants that the recording hardly separates."""
    if not fit.correlation:
        return "<p>No two constants are strongly correlated, or the fitter gives no correlations.</p>"
    a, b, r = fit.correlation[0]
    words = (
        f"<p>A correlation near ±1 means that the recording determines only a combination of the two constants. The "
        f"strongest is {escape(a)} with {escape(b)}, {r:+.5f}: measuring one of them independently (with a micrometer, "
        "a balance) makes the other more accurate too.</p>"
    )
    return words + draw.correlation_svg(fit.correlation)


def mismatch(record: StepRecord, fit: FitResult, build: Build, deciding: Sequence[Sweep]) -> str:
    """Return how well the model describes the recording and what this means, then the diagnosis.

    `deciding` are the sweeps of this and earlier steps that were made to decide a diagnosis.
    """
    chi2 = fit.chi2_per_dof
    told = record.diagnosis
    used = [sweep for sweep in deciding if told is not None and sweep.id in told.sweeps]
    findings: list[dict[str, Any]] = told.diagnosis.get("findings") or [] if told else []
    if chi2 > _BAD:
        meaning = "Well above 1: the recording shows an effect that the model lacks; the constants may be wrong."
    elif chi2 > _GOOD:
        meaning = "Somewhat above 1: the model lacks a small effect; the uncertainties are slightly too small."
    elif findings:
        meaning = "Near 1, but only because the constants absorb what the diagnosis below has found."
    else:
        meaning = "Near 1: model and recording agree to within the noise."
    words = [
        f"Misfit per degree of freedom {chi2:.3g}; typical relative misfit {fit.rms_log_error:.2g}, noise per point "
        f"{fit.noise.relative:.1e} (from {fit.noise.source}). {meaning}",
        *([] if fit.converged else ["The fit did not converge: its numbers are only a starting point."]),
        *fit.says,
        *record.refusals,
    ]
    html = "".join(f"<p>{escape(word)}</p>" for word in words)
    if told is None:
        return html + "<p>The journal holds no diagnosis of this measurement.</p>"
    if used:
        bands = ", ".join(_band(sweep) for sweep in used)
        html += f"<p>The diagnosis has the fitted sweeps and those that were made to decide it: {bands}.</p>"
    return html + diagnosis_section(told.diagnosis, record.diagnosis_curves, build)


def provenance(record: SampleRecord, fits: Iterable[FitResult]) -> str:
    """Return everything needed to repeat measurement and fit: versions, instrument, hashes, settings."""
    build = hashlib.sha256(to_json(record.build)).hexdigest()
    rows: list[Sequence[str]] = [("pzctl", version("pzctl")), ("build file, SHA-256 of its content", build)]
    rows += [(f"fitter at {fit.steps[-1]}", f"{fit.fitter} {fit.version}") for fit in fits]
    for step in record.steps:
        rows.append((f"instrument at {step.measurement.sample.step}", step.idn))
        rows.append((f"measurement of {step.measurement.sample.step}", step.measurement.id))
        for sweep in (*step.sweeps, *step.deciding):
            digest = hashlib.sha256(sweep.frequency.tobytes() + sweep.impedance.tobytes()).hexdigest()
            rows.append((f"sweep {sweep.id}", f"SHA-256 of its numbers {digest}"))
            rows.append(("settings as read back", _in_words(sweep.settings)))
    return table(("what", "value"), rows)


def _in_words(settings: Mapping[str, Any]) -> str:
    """Return settings as text; a long list is replaced by its length, as the journal holds all its values."""
    return ", ".join(f"{name} {_in_short(value)}" for name, value in settings.items() if value not in (None, [], ()))


def _in_short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, Sized) and not isinstance(value, str) and len(value) > _FEW:
        return f"{len(value)} values"
    return str(value)
