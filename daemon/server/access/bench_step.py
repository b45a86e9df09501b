"""The gluing step of the device on the simulated bench, so that no measurement is recorded under a wrong step."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

from ..requests.request_errors import RequestError

GLUING = ("step", "next", "new-sample")
"""Commands of the bench that change the device."""


class BenchStep:
    """The step that was glued last through the daemon, and the client that glued it.

    A measurement of another step of the bench is refused, and so is gluing while a measurement runs or waits.
    Therefore the device stays at the requested step from the request of a measurement until it is recorded.
    """

    def __init__(self) -> None:
        self._step: str | None = None
        self._steps: frozenset[str] = frozenset()
        self._by = ""
        self._changing = 0

    @contextmanager
    def command(self, command: Mapping[str, Any], client: str, *, busy: bool) -> Generator[dict[str, Any]]:
        """Run a client's bench command in this context, and put the bench's answer into the yielded dict.

        Raises RequestError if the command would change the device during a measurement.
        """
        answer: dict[str, Any] = {}
        if command.get("command") not in GLUING:
            yield answer
            return
        if busy and command != {"command": "step", "name": self._step}:
            raise RequestError("busy", "bench: no gluing while a measurement runs or waits", "ask again later")
        self._changing += 1
        try:
            yield answer
        finally:
            self._changing -= 1
        self._step, self._steps, self._by = answer.get("step"), frozenset(answer.get("steps", ())), client

    def check(self, step: str) -> None:
        """Raise RequestError if the device on the bench is at another step, or is being glued."""
        if self._changing:
            raise RequestError("busy", "bench: a layer is being glued", "ask again when that command is answered")
        if self._step is not None and step != self._step and step in self._steps:
            raise RequestError(
                "bench-failed",
                f"the device on the bench is at step {self._step!r}, glued by {self._by!r}, so step {step!r} cannot be "
                "measured",
                "glue first; with a lease nobody else glues or measures meanwhile",
            )
