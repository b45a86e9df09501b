"""Where the command line prints: what comes from outside is text there, neither markup nor a terminal's commands."""

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.status import Status
from rich.style import StyleType
from rich.text import Text

from ...models.base.names import shown

_PIPED_WIDTH = 120
"""Columns where nobody says how wide the screen is: a pipe, a file."""


class PlainConsole(Console):
    r"""A console to which `[red]` is a word in brackets, and which shows an escape as `\x1b`."""

    def __init__(self, *, stderr: bool, quiet: bool, width: int | None = None) -> None:
        super().__init__(stderr=stderr, quiet=quiet, width=width, markup=False, emoji=False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield what is printed, every character of it one that can be."""
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
        """Return a spinner beside these words, which Rich would take for markup."""
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
    """Print nothing on standard error but errors and notes: no progress, no hints."""
    _Manner.quiet = quiet


def console(stderr: bool = False) -> PlainConsole:
    """Return a console on standard output or standard error; no colour and a fixed width where it is piped.

    Colour goes as people expect: off with NO_COLOR or where it is piped, on with FORCE_COLOR.
    """
    silent = stderr and _Manner.quiet
    plain = PlainConsole(stderr=stderr, quiet=silent)
    return plain if plain.is_terminal else PlainConsole(stderr=stderr, quiet=silent, width=_PIPED_WIDTH)
