"""Strict parsing of an instrument's answers: numbers, flags, words, blocks of big-endian doubles.

Nothing is guessed: an answer that does not have exactly the expected form raises InstrumentError with a sentence that
quotes it. The forms are those of IEEE 488.2.
"""

import math
import re
from collections.abc import Collection

import numpy as np

from ...models.base.arrays import Reals
from ..base.analyzer import InstrumentError

# Integer form `201` or `+201`, floating form with exponent. A leading space does occur.
_NUMBER = re.compile(r" ?[+-]?(\d+\.?\d*|\.\d+)([Ee][+-]?\d{1,3})?", re.ASCII)
_INTEGER = re.compile(r" ?[+-]?\d{1,9}", re.ASCII)

QUOTED_CHARACTERS = 60
"""Greatest number of characters of an answer that an error quotes."""


def quote(text: str) -> str:
    """Return `text` for an error: in quotes, shortened, with control characters escaped."""
    return repr(text if len(text) <= QUOTED_CHARACTERS else text[:QUOTED_CHARACTERS] + "...")


def number(text: str, what: str) -> float:
    """Return `text` as a finite number. Raises InstrumentError."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise InstrumentError(f"{what}: the answer is {quote(text)}; a finite number is expected")
    return value


def integer(text: str, what: str) -> int:
    """Return `text` as an integer. Raises InstrumentError."""
    if not _INTEGER.fullmatch(text):
        raise InstrumentError(f"{what}: the answer is {quote(text)}; an integer is expected")
    return int(text)


def flag(text: str, what: str) -> bool:
    """Return True for `1` or `ON`, False for `0` or `OFF`. Raises InstrumentError."""
    try:
        return {"1": True, "+1": True, "ON": True, "0": False, "+0": False, "OFF": False}[text.strip()]
    except KeyError:
        raise InstrumentError(f"{what}: the answer is {quote(text)}; 0 or 1 is expected") from None


def word(text: str, what: str, allowed: Collection[str]) -> str:
    """Return `text` if it is one of `allowed`. Raises InstrumentError."""
    if text not in allowed:
        raise InstrumentError(f"{what}: the answer is {quote(text)}; one of {', '.join(sorted(allowed))} is expected")
    return text


def block_length(header: bytes, digits: int, what: str) -> int:
    """Return the number of data bytes from the `header` of a block, such as `#6` and six digits.

    Raises InstrumentError.
    """
    length = header[2:]
    if len(header) != 2 + digits or header[:2] != b"#%d" % digits or not length.isdigit():
        shown = quote(header.decode("latin-1"))
        raise InstrumentError(f"{what}: the answer begins with {shown}; #{digits} and {digits} digits are expected")
    return int(length)


def doubles(data: bytes, count: int, what: str) -> Reals:
    """Return `count` big-endian doubles, shape (count,), from a block's `data`. Raises InstrumentError.

    Every value has to be finite, and the length exact.
    """
    if len(data) != 8 * count:
        raise InstrumentError(f"{what}: {len(data)} bytes came; {8 * count} bytes ({count} numbers) are expected")
    values = np.frombuffer(data, dtype=">f8").astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise InstrumentError(f"{what}: number {bad[0] + 1} is {values[bad[0]]}; only finite numbers are allowed")
    return values
