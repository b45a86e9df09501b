"""`pzctl prove`: make blind cases, diagnose them without knowing their truth, and score the answers."""

import json
import subprocess
import sys
import time
from datetime import UTC, datetime
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer

from ....models.base.errors import PzctlError

_SEALED = range(1000, 2000)
"""Seeds of the sealed cases, which are never used while the diagnosis is developed."""
_PATIENCE = 10.0
"""Seconds that a child process has to end its own children."""


class ProofWorld(StrEnum):
    """The simulated world that cases come from."""

    ideal = "ideal"
    """White noise, exact effects."""
    lab = "lab"
    """Realistic devices, instruments and effects."""


class ProveError(PzctlError):
    """A proof that cannot be run as requested."""


def prove(
    world: Annotated[
        ProofWorld, typer.Option(help="The kind of cases: exact effects with white noise, or as in a laboratory.")
    ] = ProofWorld.ideal,
    real: Annotated[
        Path | None, typer.Option(help="Folder of real recordings to add exact parts to, in place of simulated cases.")
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="Number of simulated cases.")] = 300,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the cases; 1000 to 1999 are never used in development.")
    ] = 1,
    jobs: Annotated[int, typer.Option(min=1, help="Number of processes that run at the same time.")] = 2,
    out: Annotated[Path, typer.Option(help="Folder for cases, truth, answers and page.")] = Path("proof"),
    runs: Annotated[
        Path | None,
        typer.Option(help="List of all sealed runs; a sealed run is added to it. [default: OUT/runs.json]"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Test the diagnosis on blind cases: make them, publish the hash of their truth, diagnose and score them.

    Example: pzctl prove --world lab --count 60 --out proof
    """
    from ...report.terminal import console

    if real is not None and not real.is_dir():
        raise ProveError(f"{real}: no such folder; one of recordings, with a build.toml beside them, is needed")
    if (out / "truth.json").exists():
        raise ProveError(f"{out}: this folder holds a proof already; give --out another folder")
    screen = console(stderr=as_json)
    # One process makes the cases and another one scores them, so the process that diagnoses never sees the truth.
    if real is not None:
        published = _child("pzctl.daemon.cli.proof.plant_real", real, out, seed).strip()
    else:
        published = _child("pzctl.sim.blind_cases", out, seed, count, jobs, world).strip()
    screen.print(f"SHA-256 of the truth: {published}", highlight=False, soft_wrap=True)
    sealed = seed in _SEALED
    kind, listed = "real" if real is not None else str(world), runs or out / "runs.json"
    if sealed:
        _enter(listed, kind, seed, len(list((out / "cases").iterdir())), published)
    began = time.perf_counter()
    answers = _diagnose_all(sorted((out / "cases").iterdir()), jobs, out / "answers.json")
    part = "Sealed part, never used while the diagnosis was developed" if sealed else "Development cases"
    title = f"{part}: seed {seed}, {_commit()}."
    seconds = time.perf_counter() - began
    scored = _judged(kind, out, published, title, jobs, listed if sealed else None)
    if as_json:
        print(json.dumps({"sha256": published, "cases": len(answers), "seconds": seconds, **scored}))
        return
    screen.print(Path(scored["page"]).read_text(encoding="utf-8"), markup=False, highlight=False, soft_wrap=True)
    screen.print(f"{len(answers)} cases in {seconds:.0f} s; page: {scored['page']}", highlight=False)


def _enter(listed: Path, world: str, seed: int, count: int, published: str) -> None:
    """Add a sealed run to the list before anything is diagnosed, so that an interrupted run is listed too."""
    from ....fitters.proof.run_list import SealedRun, enter

    now = datetime.now(UTC).isoformat(timespec="minutes").removesuffix("+00:00")
    enter(listed, SealedRun(world, seed, count, _commit(), published, now))


def _judged(kind: str, out: Path, published: str, title: str, jobs: int, listed: Path | None) -> dict[str, Any]:
    """Score the answers of a proof and return its page and figures."""
    kept = [listed] if listed is not None else []
    if kind == "lab":
        return json.loads(_child("pzctl.fitters.proof.lab_page", out, published, title, *kept))
    if kind == "real":
        return json.loads(_child("pzctl.fitters.proof.planted_page", out, published, title, *kept))
    from .oracle_run import tell_all

    tell_all(out, published, jobs)
    return json.loads(_child("pzctl.fitters.proof.proof_page", out, published, title, *kept))


def _commit() -> str:
    """Return which code was tested: the commit of its git checkout, or its version."""
    run = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        done = subprocess.run(run, capture_output=True, text=True, check=True)  # noqa: S603 (fixed words, no shell)
    except (OSError, subprocess.CalledProcessError):
        return f"version {version('pzctl')}"
    return f"commit {done.stdout.strip()}"


def _child(module: str, *words: object) -> str:
    """Run a module of pzctl in a child process and return its output. Raises ProveError."""
    from ....fitters.population.process_pool import ctrl_c_blocked

    run = [sys.executable, "-m", module, *map(str, words)]
    with ctrl_c_blocked():  # this process handles Ctrl-C and ends the child
        process = subprocess.Popen(  # noqa: S603 (our own module, no shell)
            run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
    with process:
        try:
            printed, complained = process.communicate()
        except BaseException:
            process.terminate()
            process.wait(_PATIENCE)  # it has children of its own to end
            raise
    if process.returncode:
        if len(complained.splitlines()) == 1:
            raise ProveError(complained.strip())
        sys.stderr.write(complained)
        raise ProveError(f"{module} ended with status {process.returncode}; its output above says why")
    return printed


def _diagnose_all(folders: list[Path], jobs: int, kept: Path) -> dict[str, Any]:
    """Diagnose every case; write each answer to `kept` and print it on standard error as soon as it is there."""
    from concurrent.futures import as_completed

    from ....fitters.population.process_pool import started
    from ...report.terminal import console
    from .run_case import diagnose_case

    answers: dict[str, Any] = {}
    with started(diagnose_case, folders, jobs) as waiting:
        for done in as_completed(waiting):
            name = waiting[done].name
            defect = done.exception()  # a defect of pzctl counts as a wrong answer; the other cases go on
            answers[name] = {"error": f"a defect: {defect!r}"} if defect else done.result()
            effects = [finding["effect"] for finding in answers[name].get("findings", [])]
            kept.write_text(json.dumps(dict(sorted(answers.items()))), encoding="utf-8")
            says = f"{len(answers)}/{len(folders)} {name}: {', '.join(effects) or 'nothing'}"
            console(stderr=True).print(says, markup=False, highlight=False, soft_wrap=True)
    return answers
