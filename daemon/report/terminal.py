"""The consoles of the command line, which print text from outside as plain text: no markup, no terminal commands."""

import threading
import time
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.status import Status
from rich.style import StyleType
from rich.text import Text

from ...models.base.names import shown

_PIPED_WIDTH = 120
"""Columns of output to a pipe or a file."""
_FIRST = 10.0
"""Seconds after which a pipe or a file gets the first line about what is going on, s."""


class PlainConsole(Console):
    r"""A console that prints `[red]` as it is and an escape character as `\x1b`."""

    def __init__(self, *, stderr: bool, quiet: bool, width: int | None = None) -> None:
        super().__init__(stderr=stderr, quiet=quiet, width=width, markup=False, emoji=False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments to print, with every character that cannot be printed escaped."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(shown(segment.text, keep="\n\t"), segment.style)

    def status(
        self,
        status: RenderableType,
        *,
        spinner: str = "dots",
        spinner_style: StyleType = "status.spinner",
        speed: float = 1.0,
        refresh_per_second: float = 12.5,
    ) -> Status:
        """Return a spinner beside this text, which Rich would otherwise read as markup; lines of it in a pipe."""
        words = Text(status) if isinstance(status, str) else status
        if not self.is_terminal:
            return _PipedStatus(words, console=self)
        return super().status(
            words,
            spinner=spinner,
            spinner_style=spinner_style,
            speed=speed,
            refresh_per_second=refresh_per_second,
        )


class _PipedStatus(Status):
    """Prints its present text after ten seconds, and again each time when twice as much has passed."""

    def start(self) -> None:
        """Begin to print."""
        self._ended = threading.Event()
        self._printing = threading.Thread(target=self._print, daemon=True)
        self._printing.start()

    def stop(self) -> None:
        """Print no more."""
        self._ended.set()
        self._printing.join()

    def _print(self) -> None:
        begun, wait = time.monotonic(), _FIRST
        while not self._ended.wait(wait):
            passed = time.monotonic() - begun
            self.console.print(f"{self.status} ({passed:.0f} s)", highlight=False, soft_wrap=True)
            wait = passed


class _Manner:
    quiet = False


def be_quiet(quiet: bool) -> None:
    """Print only errors and notes on standard error, no progress and no hints, if `quiet` is set."""
    _Manner.quiet = quiet


def is_quiet() -> bool:
    """Whether `be_quiet` was set."""
    return _Manner.quiet


def console(stderr: bool = False) -> PlainConsole:
    """Return a console on standard output or standard error; piped output has a fixed width.

    Colour is off with NO_COLOR or in piped output, and on with FORCE_COLOR.
    """
    silent = stderr and _Manner.quiet
    plain = PlainConsole(stderr=stderr, quiet=silent)
    return plain if plain.is_terminal else PlainConsole(stderr=stderr, quiet=silent, width=_PIPED_WIDTH)
