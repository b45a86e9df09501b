"""`pzctl measure --diagnose`: diagnose a step and, with consent, make the sweeps that decide between explanations."""

import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import typer

from ....models.base.names import as_file_name

if TYPE_CHECKING:
    from rich.console import Console

    from ....models.build import Build
    from ....models.sweep_plan import SweepPlan
    from ...client.client import Client
    from ...client.result_waiter import Measurement

_OPEN = 0.05
"""Probability of an alternative above which a finding counts as undecided."""
_MOST_ROUNDS = 2
"""Greatest number of rounds of further measurements for one step."""


@dataclass
class Diagnoser:
    """Diagnoses one step after the other; further measurements of one step are used in all later diagnoses."""

    lab: "Client"
    build: "Build"
    console: "Console"
    sweep: Callable[["SweepPlan", str, str], "Measurement"]
    """Measures with (plan, step, id of the measurement whose diagnosis it helps to decide)."""
    yes: bool
    """Whether to measure without asking."""
    aside: list[str] = field(default_factory=list[str])
    """The ids of the further measurements of all steps."""

    def step(self, step: str, measurement: str) -> dict[str, Any]:
        """Diagnose a step, make the deciding sweeps, and return the last diagnosis with its picture and these sweeps.

        No sweep is proposed for effects alone for which one was made already: it would not decide more.
        Raises FitError if the step cannot be diagnosed, DaemonError.
        """
        from ...report.tables.diagnosis_output import print_constants, print_diagnosis

        measured: list[dict[str, Any]] = []
        asked: set[str] = set()
        diagnosis: dict[str, Any] = {}
        for left in range(_MOST_ROUNDS, -1, -1):
            with self.console.status(f"{step}: diagnosing"):
                diagnosis = self.lab.diagnose(measurement, also=self.aside, propose=left > 0)
            print_diagnosis(self.console, diagnosis)
            proposed = [one for one in diagnosis.get("would_measure", []) if _effects(one) - asked]
            agreed = [proposal for proposal in proposed if self._agreed(step, proposal)]
            if not proposed:
                self._by_hand(diagnosis)
            if not agreed:
                break
            measured += [self._measured(step, measurement, proposal) for proposal in agreed]
            asked.update(*map(_effects, agreed))
        if diagnosis["findings"] and diagnosis["final"].get("constants"):
            print_constants(self.console, diagnosis)
        picture = self._picture(step, measurement)
        return diagnosis | {"step": step, "measurement": measurement, "decided_by": measured, "picture": picture}

    def _by_hand(self, diagnosis: dict[str, Any]) -> None:
        """Print what a person could do if no sweep can decide."""
        from ....fitters.user_effects import find_any_effect
        from ....models.effects import EffectError

        for finding in diagnosis["findings"]:
            others = [
                alternative["effect"] for alternative in finding["alternatives"] if alternative["probability"] > _OPEN
            ]
            for name in (finding["effect"], *others) if others else ():
                with suppress(EffectError):
                    says = f"to tell {finding['effect']} from {', '.join(others)}: {find_any_effect(name).separates}"
                    self.console.print(f"no sweep can decide; {says}", style="cyan", highlight=False, soft_wrap=True)

    def _agreed(self, step: str, proposal: dict[str, Any]) -> bool:
        """Propose a measurement and return whether to make it."""
        says = f"{step}: {proposal['what']}, {proposal['why']}: {_duration(proposal['seconds'])}"
        self.console.print(f"proposal for {says}", style="cyan", highlight=False, soft_wrap=True)
        if self.yes:
            return True
        if not sys.stdin.isatty():
            self.console.print("not measured: this is no terminal to ask in, and --yes was not given", style="dim")
            return False
        return typer.confirm("Measure it now?", default=True, err=True)

    def _measured(self, step: str, measurement: str, proposal: dict[str, Any]) -> dict[str, Any]:
        from ...report.json_output.experiment_json import plan_in

        decisive = self.sweep(plan_in(proposal), step, measurement)
        self.aside.append(decisive.id)
        return {"id": decisive.id, "sweeps": [sweep.id for sweep in decisive.sweeps], **proposal}

    def _picture(self, step: str, measurement: str) -> str:
        """Draw the latest diagnosis of a measurement; return the picture's path."""
        from ...files.paths import home
        from ...report.pictures.diagnosis_picture import diagnosis_picture
        from ...wire.events import DiagnosisEvent
        from ...wire.result_messages import curves_of

        received = [answer for answer in self.lab.fits(measurement) if isinstance(answer.event, DiagnosisEvent)][-1]
        assert isinstance(received.event, DiagnosisEvent)  # noqa: S101 - the filter above
        curves = curves_of(received.event.curves, received.arrays)
        path = home() / "pictures" / f"{as_file_name(self.build.name, step)}-diagnosis.png"
        drawn = diagnosis_picture(received.event.diagnosis, curves, self.build, path)
        self.console.print(f"picture: {drawn}\n", highlight=False, soft_wrap=True)
        return str(drawn)


def _effects(proposal: dict[str, Any]) -> set[str]:
    """Return the effects that a proposed measurement would show or exclude."""
    return {question["effect"] for question in proposal["decides"]}


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
