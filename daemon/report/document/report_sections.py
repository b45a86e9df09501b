"""The sections of a report, each as HTML. Every name and sentence from outside is escaped."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence, Sized
from html import escape
from importlib.metadata import version
from typing import Any

from ....fitters.interface import FitResult
from ....models.build import Build
from ...samples.sample_record import SampleRecord, StepRecord
from ...wire.frames import to_json
from ..pictures import svg_pictures as draw
from ..tables.deviation import deviation
from ..tables.fit_tables import derived_shown
from ..tables.numbers import complex_with_uncertainty, with_uncertainty
from .diagnosis_section import diagnosed
from .html_table import table

_FEW = 8
"""Numbers of one setting that are written out."""
_BAD, _GOOD = 2.0, 1.2
"""Misfits per degree of freedom: above the first the model lacks something, below the second it lacks nothing."""


def measured(record: SampleRecord) -> str:
    """Return what was measured: a row for each sweep; then what was withdrawn."""
    rows = [
        (
            one.measurement.sample.step,
            sweep.time[:19].replace("T", " "),
            f"{sweep.frequency[0] / 1e6:.4g} - {sweep.frequency[-1] / 1e6:.4g} MHz",
            str(sweep.frequency.size),
            _drive(sweep.settings),
            str(sweep.settings.get("bandwidth", "")),
            "; ".join((*((one.withdrawal.says,) if one.withdrawal else ()), *sweep.notes)),
        )
        for one in record.steps
        for sweep in one.sweeps
    ]
    shown = table(("step", "begun (UTC)", "band", "points", "oscillator", "bandwidth", "notes"), rows)
    return shown + "".join(f"<p>{escape(says)}.</p>" for says in record.withdrawn)


def _drive(settings: Any) -> str:
    for key, unit in (("oscillator_A", "A"), ("oscillator_V", "V")):
        if isinstance(settings.get(key), int | float):
            return f"{settings[key]:g} {unit}"
    return ""


def constants(fit: FitResult, build: Build) -> str:
    """Return the constants beside the data sheet; how far they are off in standard uncertainties of the two."""
    sheet = build.data_sheet
    rows: list[Sequence[str]] = []
    classes: list[str] = []
    for name, c in fit.constants.items():
        nominal = sheet.get(name)
        value = _number(c.re, c.im, c.u_re, c.u_im)
        said = _number(nominal.re, nominal.im, nominal.u, nominal.u_im) if nominal else ""
        percent, classed = deviation(c.re, c.u_re, nominal, c.free)
        rows.append((name, value, c.unit, said, percent, nominal.source if nominal else ""))
        classes.append(classed)
    for name, c in derived_shown(fit).items():
        rows.append((name, _number(c.re, c.im, c.u_re, c.u_im), c.unit, "", "derived", ""))
        classes.append("held")
    return table(("constant", "fitted", "unit", "data sheet, build file", "deviation", "source"), rows, classes)


def _number(re: float, im: float, u_re: float | None, u_im: float | None) -> str:
    """Return a complex number whose j stays on the line of its digits."""
    return complex_with_uncertainty(re, im, u_re, u_im).replace(" j", "\N{NO-BREAK SPACE}j")


def budget(fit: FitResult) -> str:
    """Return what makes up each uncertainty, or say that this fitter does not tell."""
    if fit.budget is None:
        return f"<p>The fit that is kept of {escape(fit.fitter)} holds no budget of its uncertainties.</p>"
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
        "<p>Standard uncertainties, in the constant's unit. Squared, those of noise, dimensions and data sheets make "
        "up the square of u; what held values may do is not in it.</p>"
    )
    return note + table(heads, rows)


def _two_digits(value: float) -> str:
    return with_uncertainty(float(f"{value:.2g}"), None)


def _most(share: Any) -> str:
    return f"{share.largest[0]}: {_two_digits(share.largest[1])}"


def correlations(fit: FitResult) -> str:
    """Return which constants the recording hardly separates."""
    if not fit.correlation:
        return "<p>No two constants are strongly correlated, or the fitter does not tell.</p>"
    a, b, r = fit.correlation[0]
    words = (
        f"<p>A correlation near ±1 means that the recording fixes only a combination of the two. The strongest is "
        f"{escape(a)} with {escape(b)}, {r:+.5f}: a better value of one from elsewhere (a micrometer, a balance) "
        "makes the other better too.</p>"
    )
    return words + draw.correlation_svg(fit.correlation)


def mismatch(one: StepRecord, fit: FitResult, build: Build) -> str:
    """Return how well the model describes the recording, and what that means."""
    chi2 = fit.chi2_per_dof
    if chi2 > _BAD:
        meaning = "Well above 1: the recording shows something that the model does not have, and constants may be off."
    elif chi2 > _GOOD:
        meaning = "Somewhat above 1: a small effect is left over; uncertainties are a little too small."
    else:
        meaning = "Near 1: the model describes all that the noise lets one see."
    words = [
        f"Misfit per degree of freedom {chi2:.3g}; typical relative misfit {fit.rms_log_error:.2g}, noise per point "
        f"{fit.noise.relative:.1e} (from {fit.noise.source}). {meaning}",
        *([] if fit.converged else ["The fit did not converge: take its numbers for a beginning only."]),
        *fit.says,
        *one.refusals,
    ]
    html = "".join(f"<p>{escape(word)}</p>" for word in words)
    if one.diagnosis is None:
        return html + "<p>No diagnosis of this measurement is in the journal.</p>"
    return html + diagnosed(one.diagnosis.diagnosis, one.diagnosis_curves, build)


def provenance(record: SampleRecord, fits: Iterable[FitResult]) -> str:
    """Return what is needed to do all of it again: versions, instrument, hashes, settings."""
    build = hashlib.sha256(to_json(record.build)).hexdigest()
    rows: list[Sequence[str]] = [("pzctl", version("pzctl")), ("build file, SHA-256 of its content", build)]
    rows += [(f"fitter at {fit.steps[-1]}", f"{fit.fitter} {fit.version}") for fit in fits]
    for one in record.steps:
        rows.append((f"instrument at {one.measurement.sample.step}", one.idn))
        rows.append((f"measurement of {one.measurement.sample.step}", one.measurement.id))
        for sweep in one.sweeps:
            digest = hashlib.sha256(sweep.frequency.tobytes() + sweep.impedance.tobytes()).hexdigest()
            rows.append((f"sweep {sweep.id}", f"SHA-256 of its numbers {digest}"))
            rows.append(("settings as read back", _in_words(sweep.settings)))
    return table(("what", "value"), rows)


def _in_words(settings: Mapping[str, Any]) -> str:
    """Return settings to be read by people: of a column of numbers, how many it holds; all are in the journal."""
    return ", ".join(f"{name} {_in_short(value)}" for name, value in settings.items() if value not in (None, [], ()))


def _in_short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, Sized) and not isinstance(value, str) and len(value) > _FEW:
        return f"{len(value)} values"
    return str(value)
