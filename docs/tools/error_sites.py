"""Every place in the code that creates an error, and the pattern of its sentence, for `docs/errors.md`."""

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOMS = ("models", "drivers", "fitters", "sim", "daemon")


@dataclass(frozen=True)
class Site:
    """One place that makes an error."""

    where: str
    """File, from the package's root."""
    kind: str
    template: str
    """The sentence with `...` for variable parts; empty if all of it is variable."""
    pattern: str
    """A regular expression that its sentences match."""

    def made(self, row: Mapping[str, Any]) -> bool:
        """Return whether a sentence that a test provoked, a row of provoked.jsonl, comes from here."""
        same = (row["where"], row["kind"]) == (self.where, self.kind)
        return same and re.fullmatch(self.pattern, row["says"], re.DOTALL) is not None


def sites(root: Path, kinds: Sequence[str]) -> list[Site]:
    """Return the places in the packages below `root` that create an error of one of `kinds`, by file and line."""
    return [
        site
        for room in ROOMS
        for path in sorted((root / room).rglob("*.py"))
        for site in _of_file(path, path.relative_to(root).as_posix(), kinds)
    ]


def _of_file(path: Path, where: str, kinds: Sequence[str]) -> Iterator[Site]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and (kind := _name(node.func)) in kinds and node.args:
            # A code may precede the sentence: RequestError("busy", "the instrument measures ...").
            says = node.args[1] if kind == "RequestError" and len(node.args) > 1 else node.args[0]
            parts = list(_parts(says))
            template = "".join("..." if part is None else part for part in parts)
            pattern = "".join(".*" if part is None else re.escape(part) for part in parts)
            yield Site(where, kind, template if any(parts) else "", pattern)


def _name(function: ast.expr) -> str:
    if isinstance(function, ast.Name):
        return function.id
    return function.attr if isinstance(function, ast.Attribute) else ""


def _parts(says: ast.expr) -> Iterator[str | None]:
    """Yield the constant parts of a sentence, and None for variable parts."""
    match says:
        case ast.Constant(value=str(text)):
            yield text
        case ast.JoinedStr(values=values):
            for value in values:
                yield from _parts(value)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            yield from _parts(left)
            yield from _parts(right)
        case _:
            yield None
