"""Numbers in the commands of the bench's port: JSON has infinite ones and whole ones without limit."""

import math


def finite(value: object) -> float | None:
    """Return a value as a number, or None if it is no finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def quoted(value: object) -> str:
    """Return a value as Python writes it, cut to a length that fits into a sentence."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
