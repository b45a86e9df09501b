"""Help of every command: paragraphs flow, brackets are shown, and what takes no value shows none."""

import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from pzctl.daemon.cli.commands import app


def commands(command: Any, *words: str) -> Iterator[tuple[str, ...]]:
    """Yield the words of a command and of all commands below it."""
    yield words
    for name, below in getattr(command, "commands", {}).items():
        yield from commands(below, *words, name)


def shown(*words: str) -> str:
    """Return a help as it is shown on a wide terminal."""
    done = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "1000", "TERMINAL_WIDTH": "1000"})
    assert done.exit_code == 0
    return done.stdout


@pytest.mark.parametrize("words", list(commands(get_command(app))), ids=lambda words: " ".join(words) or "pzctl")
def test_a_help_is_easy_to_read(words: tuple[str, ...]) -> None:
    text = shown(*words)
    assert "bool" not in text, "a flag takes no value"
    above = text.partition("─ ")[0].splitlines()
    for line, following in pairwise(above):
        assert not (line.strip() and following.strip()), f"the line is broken after: {line.strip()}"


def test_brackets_are_shown() -> None:
    assert re.search(r"default: \[limits\] of the build file", shown("measure"))


def test_a_value_that_is_none_of_several_is_refused_in_plain_words() -> None:
    done = CliRunner().invoke(app, ["diagnose", "--hold-out", "x", "disk=a.csv"], env={"COLUMNS": "200"})
    assert done.exit_code == 2
    assert "Invalid value for '--hold-out': 'x' is not one of 'bands', 'repeats', 'overtones'" in done.stderr
