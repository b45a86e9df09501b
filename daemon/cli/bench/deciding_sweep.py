"""`pzctl measure --diagnose`: say what is wrong with a step, and measure what decides, if a person agrees."""

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
"""Probability of something else from which a finding counts as open."""
_MOST_ROUNDS = 2
"""How often what was measured may give rise to further measurements of one step."""


@dataclass
class Diagnoser:
    """Diagnoses step after step; what was measured to decide one counts in all later ones."""

    lab: "Client"
    build: "Build"
    console: "Console"
    sweep: Callable[["SweepPlan", str, str], "Measurement"]
    """Measures (plan, step, measurement to decide)."""
    yes: bool
    """Whether nobody has to be asked."""
    aside: list[str] = field(default_factory=list[str])
    """The measurements that were made to decide, of all steps."""

    def step(self, step: str, measurement: str) -> dict[str, Any]:
        """Diagnose a step, measure what decides, and return the last diagnosis, with its picture and all that was done.

        Raises FitError where it cannot be diagnosed, DaemonError.
        """
        from ...report.tables.diagnosis_output import print_diagnosis

        made: list[dict[str, Any]] = []
        found: dict[str, Any] = {}
        for left in range(_MOST_ROUNDS, -1, -1):
            with self.console.status(f"{step}: diagnosing"):
                found = self.lab.diagnose(measurement, also=self.aside, propose=left > 0)
            print_diagnosis(self.console, found)
            agreed = [one for one in found.get("would_measure", []) if self._agreed(step, one)]
            if not agreed:
                self._by_hand(found)
                break
            made += [self._measured(step, measurement, one) for one in agreed]
        picture = self._picture(step, measurement)
        return found | {"step": step, "measurement": measurement, "decided_by": made, "picture": picture}

    def _by_hand(self, found: dict[str, Any]) -> None:
        """Say what a person could do where the instrument alone cannot decide."""
        from ....models.effects import EffectError, find_effect

        if found.get("would_measure"):
            return
        for finding in found["findings"]:
            others = [one["effect"] for one in finding["alternatives"] if one["probability"] > _OPEN]
            for name in (finding["effect"], *others) if others else ():
                with suppress(EffectError):
                    says = f"to tell {finding['effect']} from {', '.join(others)}: {find_effect(name).separates}"
                    self.console.print(f"no sweep can decide; {says}", style="cyan", highlight=False, soft_wrap=True)

    def _agreed(self, step: str, proposal: dict[str, Any]) -> bool:
        """Propose a measurement, and return whether it is to be made."""
        says = f"{step}: {proposal['what']}, {proposal['why']}: {_duration(proposal['seconds'])}"
        self.console.print(f"proposal for {says}", style="cyan", highlight=False, soft_wrap=True)
        if self.yes:
            return True
        if not sys.stdin.isatty():
            self.console.print("not measured: nobody can be asked here, and --yes was not given", style="dim")
            return False
        return typer.confirm("Measure it now?", default=True, err=True)

    def _measured(self, step: str, measurement: str, proposal: dict[str, Any]) -> dict[str, Any]:
        from ...report.json_output.experiment_json import plan_in

        done = self.sweep(plan_in(proposal), step, measurement)
        self.aside.append(done.id)
        return {"id": done.id, "sweeps": [sweep.id for sweep in done.sweeps], **proposal}

    def _picture(self, step: str, measurement: str) -> str:
        """Draw the latest diagnosis of a measurement; return where the picture is."""
        from ...files.paths import home
        from ...report.pictures.diagnosis_picture import diagnosis_picture
        from ...wire.events import DiagnosisEvent
        from ...wire.result_messages import curves_of

        heard = [one for one in self.lab.fits(measurement) if isinstance(one.event, DiagnosisEvent)][-1]
        assert isinstance(heard.event, DiagnosisEvent)  # noqa: S101 - of what was filtered above
        curves = curves_of(heard.event.curves, heard.arrays)
        path = home() / "pictures" / f"{as_file_name(self.build.name, step)}-diagnosis.png"
        drawn = diagnosis_picture(heard.event.diagnosis, curves, self.build, path)
        self.console.print(f"picture: {drawn}\n", highlight=False, soft_wrap=True)
        return str(drawn)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
