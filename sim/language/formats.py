"""How arrays leave and enter the instrument: FORM2 to FORM5 (PM p.78-80)."""

from collections.abc import Iterable

import numpy as np

from ...models.base.arrays import Reals
from .messages import CommandError, block_bytes

DTYPES = {2: ">f4", 3: ">f8", 5: "<f4"}
"""Binary formats: 32 bit, 64 bit, both big-endian; FORM5 is FORM2 with its bytes reversed."""


def block(data: bytes) -> bytes:
    """Return `#6`, six digits of byte count, and the data (the reply's newline comes after it)."""
    return b"#6%06d" % len(data) + data


def encode(values: Reals, form: int, digits: int = 6) -> bytes:
    """Return an array as the reply to an array query; `digits` after the point where the format is ASCII."""
    if form in DTYPES:
        with np.errstate(over="ignore", under="ignore"):
            return block(np.asarray(values).astype(DTYPES[form]).tobytes())
    return ",".join(f"{v:+.{digits}E}" for v in values).encode("ascii")


def pairs(first: Reals, second: Reals) -> Reals:
    """Return two arrays of shape (N,) interleaved, shape (2N,)."""
    return np.column_stack((first, second)).ravel()


def decode(arguments: tuple[bytes, ...], form: int, count: int) -> Reals:
    """Return the `count` numbers of an INPU... command, ASCII or a block of the format. Raises CommandError."""
    if len(arguments) == 1 and arguments[0][:1] == b"#":
        data = block_bytes(arguments[0])
        dtype = np.dtype(DTYPES.get(form, ">f8"))
        if len(data) != count * dtype.itemsize:
            raise CommandError(-161, "INVALID BLOCK DATA")
        return np.frombuffer(data, dtype).astype(np.float64)
    if len(arguments) != count:
        raise CommandError(-109, "MISSING PARAMETER" if len(arguments) < count else "PARAMETER NOT ALLOWED")
    return _floats(arguments)


def _floats(arguments: Iterable[bytes]) -> Reals:
    try:
        values = np.array([float(a) for a in arguments])
    except ValueError as error:
        raise CommandError(-104, "DATA TYPE ERROR") from error
    if not np.all(np.isfinite(values)):
        raise CommandError(-104, "DATA TYPE ERROR")
    return values


def seven_digits(values: Reals) -> Reals:
    """Return the values as the instrument keeps them: seven significant digits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exponent = np.where(values == 0, 0.0, np.floor(np.log10(np.abs(values))))
    scale = 10.0 ** (6 - exponent)
    return np.round(values * scale) / scale
