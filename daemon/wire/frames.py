"""Raw columns after a JSON header: packed little-endian, unpacked without trusting the header."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from ...models.base.errors import PzctlError
from ...models.base.strict_json import JsonFault, check_json

MOST_FRAMES = 8192
"""Greatest number of frames of one message; a fit of three steps of 500 sweeps has 7,500 columns."""

LARGEST_HEADER = 1 << 20
"""Greatest size in bytes of a JSON header from an untrusted sender."""

LARGEST_FRAME = 8 << 20
"""Greatest size of a frame in bytes; libzmq closes the connection of a sender of a longer one before reading it. The
headers of events and answers may be as long, since they come from the daemon."""

LARGEST_WRITTEN = LARGEST_FRAME - 256
"""Greatest size of a frame of an event that is written: CURVE adds to it on its way, the journal `run`, `seq` ..."""

Array: TypeAlias = NDArray[np.float64] | NDArray[np.complex128]
"""One column: real or complex doubles."""

T = TypeVar("T")


class WireError(PzctlError):
    """A message is not valid on this wire."""


class ColumnHeader(msgspec.Struct, frozen=True):
    """The content of one raw frame: C order, little-endian; `<c16` is pairs of doubles re, im, re, im ..."""

    name: str
    unit: str
    dtype: Literal["<f8", "<c16"]
    shape: tuple[Annotated[int, msgspec.Meta(ge=0)], ...]


def pack(name: str, unit: str, array: Array) -> tuple[ColumnHeader, bytes]:
    """Return the header of an array's column, and its bytes."""
    dtype: Literal["<f8", "<c16"] = "<c16" if np.iscomplexobj(array) else "<f8"
    return ColumnHeader(name, unit, dtype, array.shape), np.ascontiguousarray(array, dtype=dtype).tobytes()


def unpack(columns: Sequence[ColumnHeader], frames: Sequence[bytes]) -> dict[str, Array]:
    """Return the arrays by name, as read-only views of the frames. Raises WireError.

    Sizes are compared before an array is made, so that a header cannot cause an allocation.
    """
    if len(columns) != len(frames):
        raise WireError(f"message: {len(frames)} raw frame(s) after a header that names {len(columns)} column(s)")
    arrays: dict[str, Array] = {}
    for column, frame in zip(columns, frames, strict=True):
        claimed = math.prod(column.shape) * np.dtype(column.dtype).itemsize
        if claimed != len(frame):
            raise WireError(
                f"message: column {column.name!r} has {len(frame)} bytes; "
                f"its shape {list(column.shape)} of {column.dtype} needs {claimed}"
            )
        if column.name in arrays:
            raise WireError(f"message: two columns are called {column.name!r}; names must differ")
        try:
            arrays[column.name] = np.frombuffer(frame, dtype=column.dtype).reshape(column.shape)
        except ValueError as error:  # an empty column of more, or longer, dimensions than an array can have
            raise WireError(f"message: column {column.name!r} cannot have its shape: {error}") from None
    return arrays


def to_json(header: Any) -> bytes:
    """Return a header as UTF-8 JSON; NumPy's numbers become numbers, and a number that is not finite becomes null."""
    return msgspec.json.encode(header, enc_hook=_plain)


def from_json(text: bytes, decoder: "msgspec.json.Decoder[T]", most: int = LARGEST_HEADER) -> T:
    """Return the decoded header. Raises WireError with the path of the fault."""
    if len(text) > most:
        raise WireError(f"message: header of {len(text)} bytes; at most {most} are allowed")
    try:
        return decoder.decode(text)
    except RecursionError:
        raise WireError("message: the header is nested too deeply") from None
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise WireError(f"message: the header is not valid: {error}") from None
    except PzctlError as error:  # a value that its type refuses, such as a segment that stops before it starts
        raise WireError(f"message: {error}") from None


def from_stranger(text: bytes, decoder: "msgspec.json.Decoder[T]") -> T:
    """Return a header that the daemon did not write, and that every reader can read. Raises WireError."""
    decoded = from_json(text, decoder)
    try:
        check_json(text)
    except JsonFault as error:
        raise WireError(f"message: {error}") from None
    return decoded


def _plain(value: object) -> Any:
    """Return NumPy's numbers and arrays as plain Python values for msgspec."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
