"""Where the command line prints."""

from rich.console import Console

_PIPED_WIDTH = 120
"""Columns where nobody says how wide the screen is: a pipe, a file."""


def console(stderr: bool = False) -> Console:
    """Return a console on standard output or standard error; no colour and a fixed width where it is piped."""
    plain = Console(stderr=stderr)
    return plain if plain.is_terminal else Console(stderr=stderr, width=_PIPED_WIDTH)
