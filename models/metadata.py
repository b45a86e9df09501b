"""Metadata of a measurement: operator, temperature, batch, barcode, and the user's own keys."""

import math
import re
from collections.abc import Mapping

from .base.errors import PzctlError
from .base.names import NameFault, check_name

TEXT_KEYS = ("operator", "batch", "barcode")
NUMBER_KEYS = ("temperature_C",)
RESERVED = ("format", "rows", "time", "id", "note", "mass_g", "mass_u_g")
"""Keys that exported files use themselves."""
MOST_KEYS = 50
LONGEST_VALUE = 200
_KEY = re.compile(r"[A-Za-z]\w{0,63}")


class MetadataError(PzctlError):
    """The metadata of a measurement are invalid."""


def check_metadata(metadata: Mapping[str, object], where: str) -> None:
    """Raise MetadataError, whose sentence begins with `where`, for an invalid key or value."""
    if len(metadata) > MOST_KEYS:
        raise MetadataError(f"{where}: {len(metadata)} keys; at most {MOST_KEYS} are allowed")
    for key, value in metadata.items():
        check_entry(key, value, where)


def check_entry(key: str, value: object, where: str) -> None:
    """Raise MetadataError for one key and its value."""
    if not _KEY.fullmatch(key):
        raise MetadataError(
            f"{where}: {key[:70]!r} is no key; a letter, then letters, digits and _ are allowed, at most 64 characters"
        )
    if key in RESERVED:
        raise MetadataError(f"{where}: {key!r} has a meaning of its own in files; give it another name")
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise MetadataError(f"{where}.{key} is {str(value)[:60]}; a text or a number is needed")
    if key in NUMBER_KEYS and isinstance(value, str):
        raise MetadataError(f"{where}.{key} is {value[:60]!r}; a number is needed")
    if key in TEXT_KEYS and not isinstance(value, str):
        raise MetadataError(f"{where}.{key} is {value}; a text in quotes is needed")
    if isinstance(value, str):
        try:
            check_name(value, f"{where}.{key}", LONGEST_VALUE)
        except NameFault as fault:
            raise MetadataError(str(fault)) from None
    elif not math.isfinite(value):
        raise MetadataError(f"{where}.{key} is {value}; a finite number is needed")


def typed_entry(key: str, text: str, where: str) -> str | float:
    """Return the typed value of a key: a number if it can be read as one, unless the key requires a text."""
    number: float | None = None
    if key not in TEXT_KEYS:
        try:
            number = float(text)
        except ValueError:
            number = None
    value = text if number is None or not math.isfinite(number) else number
    check_entry(key, value, where)
    return value
