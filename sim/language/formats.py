"""Transfer formats of arrays: FORM2 to FORM5 (PM p.78-80)."""

from collections.abc import Iterable

import numpy as np

from ...models.base.arrays import Reals
from .messages import CommandError, block_bytes

DTYPES = {2: ">f4", 3: ">f8", 5: "<f4"}
"""Binary formats: 32 bit, 64 bit, both big-endian; FORM5 is FORM2 with its bytes reversed."""


def printed(value: float) -> str:
    """Return a number in the instrument's format: 14 decimals and an exponent of three digits (PM p.175)."""
    mantissa, _, exponent = f"{value:+.14E}".partition("E")
    return f"{mantissa}E{exponent[0]}{int(exponent[1:]):03d}"


def block(data: bytes) -> bytes:
    """Return `#6`, six digits of byte count, and the data (the reply's newline comes after it)."""
    return b"#6%06d" % len(data) + data


def encode(values: Reals, form: int) -> bytes:
    """Return an array as the reply to an array query."""
    if form in DTYPES:
        with np.errstate(over="ignore", under="ignore"):
            return block(np.asarray(values).astype(DTYPES[form]).tobytes())
    return ",".join(map(printed, values.tolist())).encode("ascii")


def pairs(first: Reals, second: Reals) -> Reals:
    """Return two arrays of shape (N,) interleaved, shape (2N,)."""
    return np.column_stack((first, second)).ravel()


def decode(arguments: tuple[bytes, ...], form: int, count: int) -> Reals:
    """Return the `count` numbers of an INPU... command, ASCII or a block of the format. Raises CommandError."""
    if len(arguments) == 1 and arguments[0][:1] == b"#":
        data = block_bytes(arguments[0])
        dtype = np.dtype(DTYPES.get(form, ">f8"))
        _check_count(len(data), count * dtype.itemsize)
        return np.frombuffer(data, dtype).astype(np.float64)
    _check_count(len(arguments), count)
    return _floats(arguments)


def _check_count(found: int, wanted: int) -> None:
    if found != wanted:
        raise CommandError(54 if found > wanted else 55)


def _floats(arguments: Iterable[bytes]) -> Reals:
    try:
        values = np.array([float(a) for a in arguments])
    except ValueError as error:
        raise CommandError(-104) from error
    if not np.all(np.isfinite(values)):
        raise CommandError(-104)
    return values


def seven_digits(values: Reals) -> Reals:
    """Return the values as the instrument stores them: with seven significant digits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exponent = np.where(values == 0, 0.0, np.floor(np.log10(np.abs(values))))
    scale = 10.0 ** (6 - exponent)
    return np.round(values * scale) / scale
