"""One table of build.toml, read key by key; every error names file, key, what was found and what is allowed."""

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from ....models.base.errors import PzctlError
from ....models.base.names import likely_meant
from ....models.build import Quantity
from .file_keys import BELOW, LOSS_SIGN, POSITIVE, REAL, TIED, Entry, Key

LARGEST_WHOLE = 2**53
"""Largest whole number that every reader of JSON keeps exactly."""
SMALLEST, LARGEST = 1e-50, 1e50
"""Least and greatest size of a number: models multiply several of them, and beyond it products leave the range."""

_DECIMAL_COMMA = re.compile(r"=\s*([-+]?\d+,\d+)\s*(?:[#,}]|$)", re.MULTILINE)


_SINGLE_BRACKETS = re.compile(r"^[ \t]*\[(layers|steps|effects|materials|measure)\]", re.MULTILINE)
_LONG = 200
"""Characters of a line that is not searched for a text without quotes: the time grows with the square of its length."""
_NO_QUOTES = re.compile(r"\s*([\w-]+)\s*=\s*(\w[\w .+/-]*?)\s*(?:#.*)?")


class BuildError(PzctlError):
    """A build or materials file that cannot be used."""


def shown(value: object) -> str:
    """Return a value as the file writes it, cut to a length that fits into a sentence."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        return "a list"
    text = {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def quoted(choices: Iterable[object]) -> str:
    """Return the allowed texts as part of a sentence: `"up" or "down"`."""
    *first, last = (f'"{choice}"' for choice in choices)
    return f"{', '.join(first)} or {last}" if first else last


class Table:
    """A TOML table with its place in the file. `only` refuses unknown keys; the other methods read one key each."""

    def __init__(self, data: Mapping[str, Any], source: str, path: str = "", label: str = "") -> None:
        self.data = data
        self.source = source
        self.path = path
        self.label = label
        """The table's name for people: `layer 'glue1'`."""

    def key(self, name: str) -> str:
        """Return the full path of a key: `layers[1].thickness_mm`."""
        return f"{self.path}.{name}" if self.path else name

    def error(self, key: str, says: str) -> BuildError:
        """Return an error about a key; `says` continues the sentence that begins with the key's path."""
        of = f" (of {self.label})" if self.label else ""
        return BuildError(f"{self.source}: {self.key(key)}{of} {says}")

    def missing(self, what: str, allowed: str) -> BuildError:
        """Return an error about a missing key, or about several of which one is needed."""
        where = f"{self.path}" + (f" ({self.label})" if self.label else "") if self.path else "the file"
        return BuildError(f"{self.source}: {where} has no {what}; {allowed}")

    def only(self, allowed: Iterable[str]) -> None:
        """Refuse a key that is not among `allowed`, and suggest the nearest one. Raises BuildError."""
        names = list(allowed)
        for key in self.data:
            if key not in names:
                near = likely_meant(key, names)
                hint = f"did you mean {near[0]}? " if near else ""
                raise self.error(shown(key)[1:-1], f"is not a known key; {hint}allowed here: {', '.join(names)}")

    def string(self, key: str) -> str:
        """Return a required text. Raises BuildError."""
        if key not in self.data:
            raise self.missing(key, f'write {key} = "..."')
        value = self.data[key]
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"is {shown(value)}; a text in quotes is needed")
        return value

    def strings(self, key: str) -> tuple[str, ...]:
        """Return a required list of texts. Raises BuildError."""
        if key not in self.data:
            raise self.missing(key, f'write {key} = ["...", "..."]')
        value = self.data[key]
        if not isinstance(value, list):
            raise self.error(key, f"is {shown(value)}; a list of texts is needed")
        items = cast("list[object]", value)
        for k, item in enumerate(items):
            if not isinstance(item, str):
                raise self.error(f"{key}[{k}]", f"is {shown(item)}; a text in quotes is needed")
        return tuple(str(item) for item in items)

    def table(self, key: str) -> "Table":
        """Return a required table. Raises BuildError."""
        if key not in self.data:
            raise self.missing(f"[{key}]", f"write a section [{self.key(key)}]")
        value = self.data[key]
        if not isinstance(value, dict):
            raise self.error(key, f"is {shown(value)}; a table is needed")
        return Table(cast("dict[str, Any]", value), self.source, self.key(key), self.label)

    def tables(self, key: str, what: str) -> "tuple[Table, ...]":
        """Return a required, non-empty list of tables, each labelled with `what` and its name. Raises BuildError."""
        if key not in self.data:
            raise self.missing(f"[[{key}]]", f"write at least one {what}")
        value = self.data[key]
        if isinstance(value, dict):
            raise self.error(key, f"is one table; write [[{key}]] in double brackets before each {what}, not [{key}]")
        if not isinstance(value, list) or not value:
            raise self.error(
                key, f"is {'empty' if value == [] else shown(cast('object', value))}; at least one [[{key}]] is needed"
            )
        out: list[Table] = []
        for k, item in enumerate(cast("list[object]", value)):
            if not isinstance(item, dict):
                raise self.error(f"{key}[{k}]", f"is {shown(item)}; a table is needed")
            data = cast("dict[str, Any]", item)
            name = data.get("name")
            label = f"{what} {shown(name)}" if isinstance(name, str) else ""
            out.append(Table(data, self.source, self.key(f"{key}[{k}]"), label))
        return tuple(out)

    def number(self, key: str) -> float:
        """Return the finite number of an existing key. Raises BuildError."""
        value = self.data[key]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"is {shown(value)}; a number is needed")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"is {shown(value)}; a finite number is needed")
        if number and not SMALLEST <= abs(number) <= LARGEST:
            raise self.error(key, f"is {shown(value)}; a size from {SMALLEST:g} to {LARGEST:g} is needed, or zero")
        return number

    def integer(self, key: str) -> int:
        """Return the whole number of an existing key. Raises BuildError."""
        value = self.data[key]
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(key, f"is {shown(value)}; a whole number is needed")
        return value

    def settings(self, entries: Mapping[str, Entry]) -> dict[str, Any]:
        """Return the numbers, whole numbers and texts among `entries` that the table gives, each checked.

        Raises BuildError.
        """
        return {key: self._setting(key, entry) for key, entry in entries.items() if key in self.data}

    def _setting(self, key: str, entry: Entry) -> str | float:
        match entry.kind:
            case "number":
                value = self.number(key)
            case "integer":
                value = self.integer(key)
            case _:
                value = self.string(key)
        if not entry.accepts(value):
            allowed = entry.allowed or quoted(entry.choices)
            raise self.error(key, f"is {shown(self.data[key])}; {allowed} is needed")
        if isinstance(value, int) and value > LARGEST_WHOLE:
            raise self.error(key, f"is {shown(value)}; a whole number of at most {LARGEST_WHOLE} is needed")
        return value

    def quantity(self, key: str, what: Key) -> Quantity:
        """Return the constant of a key in SI units. Raises BuildError.

        The key holds a number, which is taken as exact, or a table {value, u} or {re, im, u, u_im}, which may also have
        min and max. The `u` of a complex value applies to its real and to its imaginary part, unless `u_im` is given.
        A tied constant, { same_as = "LAYER" }, has no value yet; `tied_parameters.resolved` sets it.
        """
        value = self.data[key]
        if not isinstance(value, dict):
            return self._checked(key, what, (self.number(key), 0.0, 0.0, 0.0))
        inner = Table(cast("dict[str, Any]", value), self.source, self.key(key), self.label)
        if "same_as" in value and what.name in TIED:
            inner.only(("same_as",))
            return Quantity(math.nan, source="build.toml", same_as=f"{inner.string('same_as')}.{what.name}")
        parts = ("value", "u") if "value" in value or what.name in REAL else ("re", "im", "u", "u_im")
        inner.only((*parts, "min", "max"))
        if parts[0] not in value:
            raise inner.missing(parts[0], f"write {key} = {{ {parts[0]} = ..., u = ... }}")
        numbers = {part: inner.number(part) for part in parts if part in value}
        for part in ("u", "u_im"):
            if numbers.get(part, 0.0) < 0:
                raise inner.error(part, f"is {numbers[part]:g}; a standard uncertainty is zero or positive")
        u = numbers.get("u", 0.0)
        u_im = numbers.get("u_im", u if "re" in numbers else 0.0)
        quantity = self._checked(key, what, (numbers[parts[0]], numbers.get("im", 0.0), u, u_im))
        if not {"min", "max"} & inner.data.keys():
            return quantity
        return replace(quantity, bounds=inner.bounds(what, numbers[parts[0]]))

    def bounds(self, what: Key, value: float) -> tuple[float, float]:
        """Return `min` and `max` in SI units; both are required, with `value` between them. Raises BuildError."""
        for end in ("min", "max"):
            if end not in self.data:
                raise self.missing(end, "a bounded value has both min and max")
        low, high = self.number("min"), self.number("max")
        if not low < value < high:
            raise self.error("min", f"is {low:g} and max {high:g}; {value:g} must lie between them")
        if what.name in POSITIVE and low <= 0:
            raise self.error("min", f"is {low:g}; a positive number is needed")
        return what.factor * low, what.factor * high

    def _checked(self, key: str, what: Key, numbers: tuple[float, float, float, float]) -> Quantity:
        re, im, u, u_im = (what.factor * n for n in numbers)
        if what.name in POSITIVE and re <= 0:
            raise self.error(key, f"is {numbers[0]:g}; a positive number is needed")
        if re >= BELOW.get(what.name, math.inf):
            raise self.error(key, f"is {numbers[0]:g}; a number below {BELOW[what.name]:g} is needed")
        sign = LOSS_SIGN.get(what.name, 0)
        if im * sign < 0:
            law = "c (1 + j/Q)" if sign > 0 else "x (1 - j tan d)"
            raise self.error(
                key,
                f"has the imaginary part {numbers[1]:g}, a gain; with exp(+jwt) a lossy {what.name} is {law}: "
                f"its imaginary part is {'positive' if sign > 0 else 'negative'} or zero",
            )
        return Quantity(re, im, u, u_im, source="build.toml")

    def quantities(self, keys: Mapping[str, Key]) -> dict[str, Quantity]:
        """Return the constants that the table gives, by name. Raises BuildError, also if one is given in two units."""
        out: dict[str, Quantity] = {}
        first: dict[str, str] = {}
        for key, what in keys.items():
            if key not in self.data:
                continue
            if what.name in first:
                raise self.error(key, f"is given beside {first[what.name]}; give one of the two")
            first[what.name] = key
            out[what.name] = self.quantity(key, what)
        return out


class TomlError(ValueError):
    """A text is no TOML."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML file. Raises TomlError, with a hint at the usual slips."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(f"{error}{_hint(text, str(error))}") from None


def decimal_point(number: str) -> str:
    """Return the hint at a decimal comma."""
    return f"write numbers with a point, not as {number!r}"


def _hint(text: str, error: str) -> str:
    """Return a hint at a decimal comma, at a text without quotes in the line of the error, or at single brackets."""
    if comma := _DECIMAL_COMMA.search(text):
        return f"; {decimal_point(comma[1])}"
    number, lines = re.search(r"at line (\d+)", error), text.split("\n")
    line = lines[min(int(number[1]), len(lines)) - 1] if number else ""
    if len(line) < _LONG and (bare := _NO_QUOTES.fullmatch(line)):
        return f'; a text needs quotes: {bare[1]} = "{bare[2]}"'
    if single := _SINGLE_BRACKETS.search(text):
        return f"; write [[{single[1]}]] in double brackets, not [{single[1]}]"
    return ""


def read_table(path: Path) -> Table:
    """Return the whole of a TOML file as a table. Raises BuildError."""
    try:
        return Table(parse_toml(path.read_text(encoding="utf-8-sig")), str(path))
    except OSError as error:
        raise BuildError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise BuildError(f"{path}: this is not TOML: {error}") from None


def keys_for(name: str, keys: Mapping[str, Key]) -> str:
    """Return the keys that give the constant `name`, as part of a sentence."""
    return " or ".join(key for key, what in keys.items() if what.name == name)
