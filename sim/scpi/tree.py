"""A tree of SCPI commands: headers in long and short forms, optional levels, numbered levels."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product

from ..language.command_entry import Act, Ask, Entry
from ..language.messages import CommandError

_LEVEL = re.compile(r"([A-Z*]+)([a-z]*)(\d*)(?:<Ch>)?")
_SENT = re.compile(r"([A-Z*]+)(\d*)")


@dataclass(frozen=True)
class Node:
    """One header in a manual's notation (`:SENSe<Ch>:FREQuency:STARt`), with the functions of its command and query."""

    header: str
    act: Act | None = None
    ask: Ask | None = None
    parameters: tuple[int, int] = (0, 0)
    """Fewest and most."""
    query_parameters: int = 0


class Tree:
    """The commands of an instrument by their headers."""

    def __init__(self, nodes: Iterable[Node]) -> None:
        self._commands: dict[tuple[str, ...], Entry] = {}
        self._queries: dict[tuple[str, ...], Entry] = {}
        self._short: dict[str, str] = {}
        for node in nodes:
            for path in self._paths(node.header):
                if node.act is not None:
                    self._commands[path] = Entry(node.act, *node.parameters)
                if node.ask is not None:
                    self._queries[path] = Entry(node.ask, 0, node.query_parameters)

    def _paths(self, header: str) -> Iterable[tuple[str, ...]]:
        """Return the paths of a header; levels in brackets are optional."""
        levels: list[tuple[str, ...]] = []
        for level in re.findall(r"\[:?[^\]]+\]|[^:\[\]]+", header):
            found = _LEVEL.fullmatch(level.strip("[]:"))
            if found is None:
                raise ValueError(f"{header}: {level} is no level")
            short, rest, number = found.groups()
            self._short[(short + rest).upper()] = self._short[short] = short
            name = short + number.removeprefix("1")
            levels.append((name, "") if level.startswith("[") else (name,))
        return (tuple(filter(None, path)) for path in product(*levels))

    def entry(self, header: str, query: bool) -> Entry:
        """Return the entry of a received header, without its question mark. Raises CommandError.

        A number 1 at the end of a level is the same as none: the first channel, the first trace.
        """
        table: Mapping[tuple[str, ...], Entry] = self._queries if query else self._commands
        path: list[str] = []
        for level in header.strip(":").upper().split(":"):
            found = _SENT.fullmatch(level)
            if found is None or found[1] not in self._short:
                raise CommandError(-113)
            path.append(self._short[found[1]] + ("" if found[2] == "1" else found[2]))
        if tuple(path) not in table:
            raise CommandError(-113)
        return table[tuple(path)]
