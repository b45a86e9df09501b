"""Bringing the device on a simulated bench to a gluing step."""

from .client import Client
from .protocol import DaemonError


class StepRefusedError(DaemonError):
    """The simulated bench cannot bring its device to this step; it may be able to bring it to another one."""


def glue(lab: Client, step: str, analyzer: str | None) -> str:
    """Let the simulated bench of an analyzer glue up to a step.

    Return why the device stays as it is where the bench does not know the step, else an empty text: such a step is
    measured with the device as it is. Raises StepRefusedError if the bench knows the step and cannot bring the device
    to it, DaemonError if every other step would be refused as well.
    """
    try:
        lab.bench({"command": "step", "name": step}, analyzer)
    except DaemonError as error:
        if error.code != "bench-failed":
            raise
        if step in lab.bench({"command": "status"}, analyzer)["steps"]:
            raise StepRefusedError(str(error), error.code) from None
        return str(error)
    return ""
