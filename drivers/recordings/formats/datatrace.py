"""The 4294A's binary data trace (`data_dt.dat` of its FTP server), which holds two traces and no frequencies."""

from pathlib import Path

import numpy as np

from ....models.base.arrays import Frequencies
from ....models.sweep import Sweep
from ..assemble import Points, assemble
from ..columns import notes_on, sign_lost
from ..convert import CONVERSIONS, SIGN_LOST, to_impedance
from ..text_file import RecordingError, TextFile, read_bytes

_PREAMBLE, _GAP, _POINT = 29, 10, 16
"""Bytes before trace A, between the traces, and of one complex point (float64, big-endian)."""


def read_data_trace(path: Path, frequency: Frequencies, parameter: str) -> Sweep:
    """Return the recording in a binary data trace.

    The file does not hold `frequency` (Hz, shape (N,)) and `parameter` (the 4294A's mnemonic, such as `IMPH`), so they
    are given as the instrument was set. Raises RecordingError.
    """
    page = TextFile(path, ())
    data = read_bytes(path)
    body = len(data) - _PREAMBLE - _GAP
    count = body // (2 * _POINT)
    if body <= 0 or body % (2 * _POINT):
        raise RecordingError(f"{path}: {len(data)} bytes cannot be two complete traces; this is not a data trace")
    if frequency.shape != (count,):
        raise RecordingError(f"{path}: {count} points found for {frequency.size} frequencies; both must agree")
    a, b = (
        np.frombuffer(data, ">c16", count, start).astype(np.complex128)
        for start in (_PREAMBLE, _PREAMBLE + count * _POINT + _GAP)
    )
    if parameter in SIGN_LOST:
        raise RecordingError(f"{path}: {sign_lost(parameter)}")
    if parameter != "COMP" and parameter not in CONVERSIONS:
        raise RecordingError(f"{path}: measurement parameter {parameter!r} is not known; IMPH is one")
    phase = np.pi / 180 if parameter in ("IMPH", "AMPH") else 1.0
    z = a if parameter == "COMP" else to_impedance(parameter, frequency, a.real, phase * b.real)
    points = Points(range(1, count + 1), np.asarray(frequency, dtype=np.float64), z)
    return assemble(page, points, {}, notes=notes_on(parameter, a.real, b.real))
