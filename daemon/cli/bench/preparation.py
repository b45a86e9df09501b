"""Bringing the device to each gluing step: by the simulated bench, or by a person at the terminal."""

import sys
from typing import TYPE_CHECKING, Any

import typer

from ....models.base.errors import CannotError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rich.console import Console

    from ...client.client import Client
    from ...wire.replies import AnalyzerState


class StepsRefusedError(CannotError):
    """Steps were not measured, because the simulated bench could not bring its device to them."""


def bring_to_step(lab: "Client", step: str, on: "AnalyzerState", console: "Console") -> None:
    """Bring the device to its step: tell the simulated bench to glue, or ask a person to.

    Raises StepRefusedError if the bench cannot bring its device to this step, DaemonError if it can do so for none.
    """
    from ...client.gluing import glue

    if on.bench is not None:
        if as_it_is := glue(lab, step, on.name):
            console.print(f"{as_it_is}; measured as it is", style="dim", highlight=False, soft_wrap=True)
    elif sys.stdin.isatty():
        typer.prompt(f"Bring the transducer to step {step!r} and press Enter", default="", show_default=False, err=True)


def reached_steps(
    lab: "Client", steps: "Iterable[str]", on: "AnalyzerState", console: "Console", refused: list[dict[str, Any]]
) -> "Iterator[str]":
    """Yield each step when the device has been brought to it; add those that the bench refuses to `refused`.

    Raises DaemonError.
    """
    from ...client.gluing import StepRefusedError

    for step in steps:
        try:
            bring_to_step(lab, step, on, console)
        except StepRefusedError as error:
            refused.append({"step": step, "says": str(error)})
            console.print(f"{step}: not measured: {error}", style="red", highlight=False, soft_wrap=True, markup=False)
        else:
            yield step


def check_refused(refused: "Sequence[dict[str, Any]]") -> None:
    """Raise StepsRefusedError if the bench refused a step."""
    if refused:
        steps = ", ".join(step["step"] for step in refused)
        raise StepsRefusedError(f"not measured: step {steps}; {refused[0]['says']}")
