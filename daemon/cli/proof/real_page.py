"""The page docs/real-recordings.md: the diagnosis of every published recording of other people's devices.

`python -m pzctl.daemon.cli.proof.real_page FOLDER PAGE` diagnoses all recordings of a folder, two at the same time, and
writes the page. `real_builds/devices.toml` has the known facts about each device.
"""

import math
import sys
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

from ....drivers.recordings import read_recording
from ....fitters.diagnosis.data_quality.data_gates import gate
from ....fitters.diagnosis.data_quality.data_issues import DataCheck
from ....fitters.diagnosis.diagnose import diagnose
from ....fitters.diagnosis.findings import Finding
from ....fitters.diagnosis.inference.data_findings import of_the_data
from ....fitters.interface import FitTask
from ....fitters.plugins import load_fitter
from ....fitters.population.process_pool import started
from ....fitters.proof.lab_page import table
from ....models.base.errors import CannotError, PzctlError
from ....models.build import Build
from ....models.sweep import Sweep
from ...files.builds.build_file import parse_build

_CIRCUIT = "bvd"
"""Fitter of devices of unknown geometry."""
_JOBS = 2


class NoRecordingsError(CannotError):
    """The folder contains none of the recordings to be diagnosed."""


@dataclass(frozen=True)
class RealDevice:
    """One device, or recordings that are fitted together, and its known facts."""

    name: str
    paths: tuple[Path, ...]
    known: str
    build: str | None
    step: str
    fitter: str
    """Fitter used instead of a diagnosis; empty if the stack's diagnosis applies."""


@dataclass(frozen=True)
class RealAnswer:
    """The answer on a device."""

    device: RealDevice
    verdict: str
    """The verdict of a diagnosis, or the fitter used instead."""
    findings: tuple[Finding, ...]
    checks: tuple[str, ...]
    """Sentences of the data checks."""
    remaining: float | None
    """Root mean square of |ln(Z_model/Z)|; None if nothing could be fitted."""
    says: str
    """The closest explanation if nothing is named; the results of a fitter, or the reason for having none."""
    seconds: float = 0.0


def devices(folder: Path) -> Iterator[RealDevice]:
    """Yield the devices whose recordings are in a folder, in the order of the list."""
    ours = files("pzctl.daemon.cli.proof") / "real_builds"
    for one in tomllib.loads((ours / "devices.toml").read_text(encoding="utf-8"))["devices"]:
        paths = sorted(folder.glob(one["recordings"]))
        build = (ours / one["build"]).read_text(encoding="utf-8") if "build" in one else None
        groups = ([paths] if paths else []) if "fitter" in one else [[path] for path in paths]
        for group in groups:
            name = group[0].parent.name if len(group) > 1 else f"{group[0].parent.name}/{group[0].stem}"
            yield RealDevice(name, tuple(group), one["known"], build, one.get("step", "device"), one.get("fitter", ""))


def answered(device: RealDevice, thin: int = 1, effects: Sequence[str] | None = None) -> RealAnswer:
    """Diagnose a device; `thin`: use every `thin`-th point; `effects`: the candidates, None for all.

    A device that no stack describes is checked and fitted by its fitter, or by a circuit.
    """
    began = time.perf_counter()
    sweeps = tuple(_thinned(read_recording(path), thin) for path in device.paths)
    build = None if device.build is None else parse_build(device.build, device.name)
    if build is None or device.fitter:
        answer = _fitted(device, build, sweeps)
    else:
        told = diagnose(FitTask(build, {device.step: sweeps}), effects)
        left = None if told.remaining is None else told.remaining.total
        nearest = told.says[1 + len(told.findings) :] if told.verdict == "unexplained" else ()
        answer = RealAnswer(device, told.verdict, told.findings, _checks(told.data), left, " ".join(nearest))
    return replace(answer, seconds=time.perf_counter() - began)


def _fitted(device: RealDevice, build: Build | None, sweeps: tuple[Sweep, ...]) -> RealAnswer:
    """Return the answer of the data checks and of a fitter."""
    gated, name = gate({device.step: sweeps}), device.fitter or _CIRCUIT
    chi2, left = float("nan"), None
    try:
        result = load_fitter(name).fit(FitTask(build, gated.sweeps))
        chi2, left = result.chi2_per_dof, result.rms_log_error
        shown = {**result.derived, **(result.constants if device.fitter else {})}
        says = ", ".join(f"{key} {one.re:.4g} {one.unit}".removesuffix(" 1") for key, one in shown.items())
    except PzctlError as error:
        says = str(error)
    findings = tuple(of_the_data(gated, chi2, float("nan")))
    return RealAnswer(device, f"no diagnosis; fitter `{name}`", findings, _checks(gated.checks), left, says)


def _checks(checks: Sequence[DataCheck]) -> tuple[str, ...]:
    return tuple(one.says for check in checks for one in check.troubles)


def _thinned(sweep: Sweep, every: int) -> Sweep:
    return sweep.at(slice(None, None, every))


def write_page(folder: Path, page: Path, heard: Callable[[RealAnswer], None] = lambda _: None) -> list[RealAnswer]:
    """Diagnose all recordings of a folder and write the page; `heard` is called with each answer.

    Raises NoRecordingsError if there is none.
    """
    listed = list(devices(folder))
    if not listed:
        raise NoRecordingsError(f"{folder}: none of the published recordings; `real_builds/devices.toml` lists them")
    answers: dict[str, RealAnswer] = {}
    with started(answered, listed, _JOBS) as waiting:
        for done in as_completed(waiting):
            answers[waiting[done].name] = done.result()
            heard(done.result())
    made = [answers[device.name] for device in listed]
    page.write_text(page_text(made), encoding="utf-8")
    return made


def page_text(answers: Sequence[RealAnswer]) -> str:
    """Return the page."""
    modelled = [one for one in answers if one.device.build is not None and not one.device.fitter]
    others = [one for one in answers if one not in modelled]
    parts = [
        "# Diagnoses of real recordings",
        "Written by `python -m pzctl.daemon.cli.proof.real_page RECORDINGS docs/real-recordings.md`, not by hand. "
        "Recordings by other people, published under open licences. The diagnosis is given the dimensions in their "
        "publications, but none of the known facts in the second column.",
        "## Devices that are stacks",
        "*Takes* is the part of the squared misfit that the finding explains beside the others, *left* the root mean "
        "square of what remains of ln Z.",
        table(
            ("recording", "known", "verdict", "named, how sure, takes", "left", "data checks, nearest", "time"),
            [_modelled_row(one) for one in modelled],
        ),
        "## Devices that no stack describes",
        "Without a geometry, or with modes that a stack does not have, the data are checked, and `radial` or an "
        "equivalent circuit with as many resonances as there is evidence for is fitted. `pzctl diagnose --fitter` "
        "looks for effects beside such a model.",
        table(
            ("recording", "known", "fitted by", "said of the data", "left", "result", "time"),
            [_other_row(one) for one in others],
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _modelled_row(one: RealAnswer) -> tuple[str, ...]:
    named = "; ".join(_said(finding) for finding in one.findings) or "nothing"
    more = " ".join((*one.checks, one.says))
    return one.device.name, one.device.known, f"`{one.verdict}`", named, _percent(one.remaining), more, _time(one)


def _other_row(one: RealAnswer) -> tuple[str, ...]:
    said = [*(f"{_said(finding)}" for finding in one.findings), *one.checks]
    fitter = one.device.fitter or _CIRCUIT
    row = one.device.name, one.device.known, f"`{fitter}`", "; ".join(said) or "nothing", _percent(one.remaining)
    return *row, one.says.replace("|", "/"), _time(one)


def _said(finding: Finding) -> str:
    sizes = ", ".join(
        f"{name} {size.value:.3g} {size.unit}".removesuffix(" 1") for name, size in finding.parameters.items()
    )
    takes = "" if math.isnan(finding.share) else f", takes {100 * finding.share:.0f} %"
    same = "".join(f", or {name}" for name in dict.fromkeys(other.effect for other in finding.same_as))
    what = f" ({sizes})" if sizes else ""
    return f"`{finding.effect}` at {finding.where}{what} {finding.probability:.2f}{takes}{same}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.2g} %"


def _time(one: RealAnswer) -> str:
    return f"{one.seconds:.0f} s"


def _main(folder: Path, page: Path) -> None:
    def heard(one: RealAnswer) -> None:
        print(f"{one.device.name}: {one.verdict}, {_percent(one.remaining)} left, {_time(one)}", file=sys.stderr)

    write_page(folder, page, heard)


if __name__ == "__main__":
    try:
        _main(Path(sys.argv[1]), Path(sys.argv[2]))
    except PzctlError as error:
        sys.exit(str(error))
