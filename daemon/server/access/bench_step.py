"""What lies on the simulated bench, as far as it was glued through the daemon: a measurement is of the step it says."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

from ..requests.request_errors import RequestError

GLUING = ("step", "next", "new-sample")
"""Commands of the bench that change the device."""


class BenchStep:
    """The step that was glued last, and by whom.

    A measurement of another one of the bench's steps is refused, and so is gluing while something is measured or
    waits: what is recorded under the name of a step was glued when it was asked for, and stays until it is recorded.
    """

    def __init__(self) -> None:
        self._step: str | None = None
        self._steps: frozenset[str] = frozenset()
        self._by = ""
        self._changing = 0

    @contextmanager
    def command(self, command: Mapping[str, Any], client: str, *, busy: bool) -> Generator[dict[str, Any]]:
        """Surround a command that a client gives the bench; what the bench answers is put into the dict.

        Raises RequestError where the command would change the device under a measurement.
        """
        answer: dict[str, Any] = {}
        if command.get("command") not in GLUING:
            yield answer
            return
        if busy and command != {"command": "step", "name": self._step}:
            raise RequestError(
                "busy", "bench: something is measured, or waits to be; nobody glues meanwhile", "ask again later"
            )
        self._changing += 1
        try:
            yield answer
        finally:
            self._changing -= 1
        self._step, self._steps, self._by = answer.get("step"), frozenset(answer.get("steps", ())), client

    def check(self, step: str) -> None:
        """Raise RequestError where a measurement of a step would be one of another step."""
        if self._changing:
            raise RequestError("busy", "bench: it is just being glued", "ask again when that is answered")
        if self._step is not None and step != self._step and step in self._steps:
            raise RequestError(
                "bench-failed",
                f"the device on the bench is at step {self._step!r}, glued by {self._by!r}; a measurement of step "
                f"{step!r} would be one of {self._step!r}",
                "glue first; who takes the lease glues and measures undisturbed",
            )
