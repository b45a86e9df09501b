"""Where the command line prints."""

from rich.console import Console

_PIPED_WIDTH = 120
"""Columns where nobody says how wide the screen is: a pipe, a file."""


class _Manner:
    quiet = False


def be_quiet(quiet: bool) -> None:
    """Print nothing on standard error but errors and notes: no progress, no hints."""
    _Manner.quiet = quiet


def console(stderr: bool = False) -> Console:
    """Return a console on standard output or standard error; no colour and a fixed width where it is piped.

    Colour goes as people expect: off with NO_COLOR or where it is piped, on with FORCE_COLOR.
    """
    silent = stderr and _Manner.quiet
    plain = Console(stderr=stderr, quiet=silent)
    return plain if plain.is_terminal else Console(stderr=stderr, quiet=silent, width=_PIPED_WIDTH)
