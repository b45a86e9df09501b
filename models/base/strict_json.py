"""JSON from outside that a parser accepts, but not every reader: a field given twice, or nesting without end.

Parsers take the last of two fields without a word, and nothing tells which is meant. How deep one can read depends on
how deep its own calls are, so that one program could keep what another cannot read.
"""

import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from .errors import PzctlError

DEEPEST = 64
"""Greatest number of objects and lists inside each other; no message of pzctl needs a quarter of it."""

_TEXT = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*"')
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


class JsonFault(PzctlError):
    """An object names a field twice, is nested too deeply, or has a field that is no JSON."""


def once_each(fields: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return the fields of an object; an `object_pairs_hook` of `json.loads`. Raises JsonFault."""
    known: dict[str, Any] = {}
    for name, value in fields:
        if name in known:
            raise JsonFault(f"the field {name[:60]!r} is given twice; give it once")
        known[name] = value
    return known


def check_json(text: bytes) -> None:
    """Check JSON text that another parser has accepted. Raises JsonFault.

    A stranger may send a megabyte of brackets, so that nothing here is done for each of them in turn.
    """
    brackets = np.frombuffer(_TEXT.sub(b"", text).translate(None, _NO_BRACKETS), np.uint8)
    deepest = int(np.cumsum((brackets & 2).astype(np.int32) - 1).max(initial=0))  # bit 1 tells [{ from ]}
    if deepest > DEEPEST:
        raise JsonFault(f"{deepest} objects and lists are nested; at most {DEEPEST} are allowed")
    objects: list[list[tuple[str, Any]]] = []
    try:
        json.loads(text.decode(), object_pairs_hook=objects.append, parse_int=str, parse_float=str)  # reads no numbers
    except ValueError as error:  # in a field that the other parser skipped
        raise JsonFault(f"a field that is not known is no JSON: {error}") from None
    for fields in objects:
        if len(fields) > 1:
            once_each(fields)
