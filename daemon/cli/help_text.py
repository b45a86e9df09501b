"""Help as it is shown: the lines of a paragraph flow, brackets are shown, and an option without a value has no type.

What is wrong with a value is said without a programmer's words.
"""

from typing import Any

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption


class Command(TyperCommand):
    """A command with such a help."""

    def __init__(self, *words: Any, **options: Any) -> None:
        """Take what a command takes."""
        super().__init__(*words, **options)
        _prepare(self)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a command line."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            error.message = error.message.removeprefix("Value error, ")
            raise

    def get_params(self, ctx: Any) -> list[Any]:
        """Return options and arguments."""
        return _without_types(super().get_params(ctx))


class Group(TyperGroup):
    """A group of commands with such a help."""

    def __init__(self, *words: Any, **options: Any) -> None:
        """Take what a group takes."""
        super().__init__(*words, **options)
        _prepare(self)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return options and arguments."""
        return _without_types(super().get_params(ctx))


def _prepare(command: TyperCommand | TyperGroup) -> None:
    command.help = "\n\n".join(" ".join(lines.split()) for lines in (command.help or "").split("\n\n"))
    for one in command.params:
        if isinstance(one, TyperOption | TyperArgument) and one.help:
            one.help = one.help.replace("[", r"\[")  # not a style of the text


def _without_types(params: list[Any]) -> list[Any]:
    """Return options and arguments of which flags show no value to be given."""
    for one in params:
        if isinstance(one, TyperOption) and one.is_flag:
            one.metavar = ""
    return params
