"""The consoles of the command line, which print text from outside as plain text: no markup, no terminal commands."""

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.status import Status
from rich.style import StyleType
from rich.text import Text

from ...models.base.names import shown

_PIPED_WIDTH = 120
"""Columns of output to a pipe or a file."""


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
        """Return a spinner beside this text, which Rich would otherwise read as markup."""
        words = Text(status) if isinstance(status, str) else status
        return super().status(
            words,
            spinner=spinner,
            spinner_style=spinner_style,
            speed=speed,
            refresh_per_second=refresh_per_second,
        )


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
