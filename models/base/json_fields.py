"""JSON objects that name a field twice: parsers take the last one without a word, and nothing tells which is meant."""

import json
from collections.abc import Sequence
from typing import Any

from .errors import PzctlError


class RepeatedField(PzctlError):
    """An object names a field twice."""


def once_each(fields: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return the fields of an object; an `object_pairs_hook` of `json.loads`. Raises RepeatedField."""
    known: dict[str, Any] = {}
    for name, value in fields:
        if name in known:
            raise RepeatedField(f"the field {name[:60]!r} is given twice; give it once")
        known[name] = value
    return known


def check_fields(text: bytes) -> None:
    """Check all objects in JSON text that another parser has accepted. Raises RepeatedField."""
    try:
        json.loads(text.decode(), object_pairs_hook=once_each, parse_int=str, parse_float=str)  # numbers are not read
    except RecursionError:
        raise RepeatedField("it is nested too deeply to see whether a field is given twice") from None
