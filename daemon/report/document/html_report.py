"""The report of one sample as one self-contained HTML file."""

from html import escape

from ....fitters.interface import FitResult
from ....fitters.plugins import DEFAULT
from ....models.base.errors import CannotError
from ....models.sweep import now_utc
from ...samples.sample_record import SampleRecord, StepRecord
from ..pictures import svg_pictures as draw
from . import report_sections as sections
from .diagnosis_section import finding_places

_STYLE = """
:root { color-scheme: light; --ink: #1a1d21; --faint: #5c6470; --line: #d5d9df; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: #fff; max-width: 72rem; margin: 0 auto;
       padding: 1rem 2rem 4rem; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.4rem; border-bottom: 2px solid var(--line); }
.faint { color: var(--faint); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; }
th, td { text-align: left; padding: .25rem .7rem; border-bottom: 1px solid var(--line); }
section:last-child td { overflow-wrap: anywhere; }
td:first-child, td:nth-child(3), td:nth-child(5) { white-space: nowrap; }
th { color: var(--faint); font-weight: 600; }
tr.held td { color: var(--faint); } tr.near td:nth-child(5) { background: #e3f3e6; }
tr.off td:nth-child(5) { background: #fdf3d3; } tr.far td:nth-child(5) { background: #fbdcd6; }
svg { max-width: 100%; height: auto; display: block; margin: 1rem 0; }
.verdict { font-weight: 700; }
tr.pass td:nth-child(7) { background: #e3f3e6; } tr.undecided td:nth-child(7) { background: #fdf3d3; }
tr.fail td:nth-child(7) { background: #fbdcd6; }
@media print { body { max-width: none; padding: 0; } h2 { break-after: avoid; } svg, tr { break-inside: avoid; } }
"""


_SCALE = "<p class='faint'>Thickness to scale; a layer too thin to be seen is drawn wider.</p>"


class NothingToReport(CannotError):
    """There is no fit to report."""


def report_html(record: SampleRecord, fitter: str | None = None) -> str:
    """Return the report of a sample: the fit of its last fitted step, and the changes from step to step.

    `fitter` selects the fits; None takes the fitter that answered the last step first. Raises NothingToReport.
    """
    chosen = _fits(record, fitter)
    if not chosen:
        raise NothingToReport(_why_nothing(record, fitter))
    last, fit = chosen[-1]
    fits = [result for _, result in chosen]
    deciding = [sweep for step in record.steps for sweep in step.deciding]
    parts = [
        ("What was measured", sections.measured(record)),
        ("The transducer", draw.stack_svg(record.build, _present(record, last), finding_places(last)) + _SCALE),
        ("Verdict", sections.verdict(fit, record.build)),
        ("Constants", sections.constants(fit, record.build)),
        ("Fit over measurement", draw.curves_svg(fit.curves, fit.noise.relative) if fit.curves else ""),
        ("Admittance circles", draw.circle_svg(fit.curves) if fit.curves else ""),
        ("Misfit, and what it means", sections.mismatch(last, fit, record.build, deciding)),
        ("From step to step", _history(fits)),
        ("Uncertainty budget", sections.budget(fit)),
        ("Correlations", sections.correlations(fit)),
        ("Provenance", sections.provenance(record, fits)),
    ]
    title = f"Transducer {record.name}: {' + '.join(fit.steps)}"
    body = "".join(f"<section><h2>{escape(head)}</h2>{html}</section>" for head, html in parts if html)
    when = now_utc()[:16].replace("T", " ")
    origin = f"fitted by {escape(fit.fitter)}, version {escape(fit.version)}; report made {when} UTC"
    return (
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{escape(title)}</title>"
        f"<meta name='viewport' content='width=device-width'><style>{_STYLE}</style></head><body>"
        f"<h1>{escape(title)}</h1><p class='faint'>{origin}</p>{body}</body></html>"
    )


def _why_nothing(record: SampleRecord, fitter: str | None) -> str:
    """Return why there is no fit, and how one is made."""
    named = f" by {fitter!r}" if fitter else ""
    what = f"sample {record.name!r}: the journal holds no fit{named}"
    makes = f"`pzctl fit --all{f' --fitter {fitter}' if fitter else ''}` makes them"
    if record.measurement is not None:
        known = record.steps[0].measurement
        what = f"measurement {known.id} of sample {record.name!r}, step {known.sample.step!r}: it has no fit{named}"
        if known.state != "measured":
            return f"{what} and gets none: it is {known.state}; only complete measurements that count are fitted"
        makes = f"`pzctl.connect().fit({known.id!r}, {fitter or DEFAULT!r})` in Python asks a running daemon for one"
    said = [says for step in record.steps for says in step.refusals]
    refused = [says for says in said if fitter is None or says.startswith(f"{fitter}: ")]
    return f"{what}; {'; '.join(refused) or makes}"


def _fits(record: SampleRecord, fitter: str | None) -> list[tuple[StepRecord, FitResult]]:
    """Return the fits of one fitter, by step."""
    fitted = [step for step in record.steps if step.fits]
    name = fitter or (fitted[-1].fits[0].fitter if fitted else "")
    return [(step, fit) for step in record.steps for fit in step.fits if fit.fitter == name]


def _present(record: SampleRecord, of: StepRecord) -> tuple[str, ...]:
    """Return the names of the layers that are present at a step."""
    return next(step.layers for step in record.build.steps if step.name == of.measurement.sample.step)


def _history(fits: list[FitResult]) -> str:
    """Return the picture of the constants that were fitted at more than one step."""
    history = {name: values for name, values in draw.last_fits(fits).items() if len(values) > 1}
    return draw.history_svg(history) if history else ""
