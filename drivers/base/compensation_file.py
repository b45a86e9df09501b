"""A compensation in a JSON file with instrument, date and exact numbers."""

from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from ...models.base.strict_json import JsonFault, check_json
from .analyzer import InstrumentError
from .capabilities import Capabilities
from .compensation import Compensation, Standard


class _Stored(msgspec.Struct, forbid_unknown_fields=True):
    """The content of the file; `arrays` holds pairs of real and imaginary part, in siemens (open) or ohm."""

    kind: str
    version: Literal[1]
    instrument: str
    adapter: str
    taken: str
    arrays: dict[Standard, list[tuple[float, float]]]
    fixture: str = ""


def save(path: Path, compensation: Compensation, model: str) -> None:
    """Write the compensation of an analyzer of this `model` to `path`, atomically.

    Raises InstrumentError if it cannot be written.
    """
    arrays = {name: [(z.real, z.imag) for z in values.tolist()] for name, values in compensation.arrays.items()}
    content: dict[str, object] = {
        "kind": _kind(model),
        "version": 1,
        "instrument": compensation.instrument,
        "adapter": compensation.adapter,
        "taken": compensation.taken,
        "arrays": arrays,
    }
    if compensation.fixture:  # earlier versions can read a file without this field
        content["fixture"] = compensation.fixture
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(msgspec.json.encode(content))
        part.replace(path)
    except OSError as error:
        raise InstrumentError(f"{path}: the compensation cannot be written: {error.strerror}") from None


def load(path: Path, can: Capabilities) -> Compensation:
    """Return the compensation in the file at `path`. Raises InstrumentError if it is not one of such an analyzer."""
    try:
        text = path.read_bytes()
        stored = msgspec.json.decode(text, type=_Stored)
        check_json(text)
    except OSError as error:
        raise InstrumentError(f"{path}: the compensation cannot be read: {error.strerror}") from None
    except (msgspec.MsgspecError, JsonFault) as error:
        raise InstrumentError(f"{path}: not a compensation: {error}") from None
    for key, value, allowed in (("kind", stored.kind, (_kind(can.model),)), ("adapter", stored.adapter, can.adapters)):
        if value not in allowed:
            fault = f"{key} is {value!r}; {', '.join(allowed)} is allowed"
            raise InstrumentError(f"{path}: not a compensation: {fault}")
    empty = [name for name, pairs in stored.arrays.items() if not pairs]
    if empty or not stored.arrays:
        raise InstrumentError(f"{path}: the compensation holds no values{' for ' + empty[0] if empty else ''}")
    arrays: dict[Standard, np.ndarray] = {
        name: np.array([complex(*pair) for pair in pairs]) for name, pairs in stored.arrays.items()
    }
    return Compensation(arrays, stored.adapter, stored.taken, stored.instrument, stored.fixture)


def _kind(model: str) -> str:
    return f"{model} compensation"
