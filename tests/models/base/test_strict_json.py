"""JSON that a parser accepts and another reader does not."""

import json
import time

import pytest

from pzctl.models.base.strict_json import DEEPEST, JsonFault, check_json


@pytest.mark.parametrize(
    "text",
    [
        b'{"a": "]]}", "b": "\\"{[", "c": [{"a": 1}, {"a": 1}]}',
        b"[" * DEEPEST + b"]" * DEEPEST,
        b'{"": 1e999, "\xc3\xa4": 1' + b"0" * 5000 + b"}",
        b"7",
    ],
)
def test_it_is_accepted(text: bytes) -> None:
    check_json(text)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b'[{"x": {"a": 1, "b": 2, "\\u0061": 1}}]', "the field 'a' is given twice; give it once"),
        (b"[" * DEEPEST + b"{}" + b"]" * DEEPEST, f"{DEEPEST + 1} objects and lists are nested; at most {DEEPEST}"),
        (b'{"unknown": "\xfd"}', "is no JSON: 'utf-8' codec can't decode byte 0xfd"),
        (b'{"unknown": "\n"}', "is no JSON: Invalid control character"),
        (b"[" * 500_000 + b"]" * 500_000, "500000 objects and lists are nested"),
    ],
)
def test_it_is_refused_with_the_reason(text: bytes, says: str) -> None:
    began = time.monotonic()
    with pytest.raises(JsonFault, match=says):
        check_json(text)
    assert time.monotonic() - began < 1


def test_a_megabyte_of_fields_is_checked_soon() -> None:
    many = json.dumps({f"k{k}": 0 for k in range(90_000)}).encode()
    began = time.monotonic()
    with pytest.raises(JsonFault, match="the field 'k5' is given twice"):
        check_json(many[:-1] + b',"k5":0}')
    assert time.monotonic() - began < 2
