"""The screen as a TIFF: both traces over the sweep, in the instrument's 640 x 480 pixels."""

import struct

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Reals

WIDTH, HEIGHT = 640, 480
FRAME = (40, 40, 600, 440)
"""Left, top, right, bottom of the graticule."""

COLOURS = ((0, 0, 0), (90, 90, 90), (255, 255, 0), (0, 255, 255))
"""Background, graticule, trace A, trace B."""


def screen(first: Reals, second: Reals) -> bytes:
    """Return the picture of two traces, each of shape (N,), as a palette TIFF, uncompressed."""
    dots = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    _graticule(dots)
    for colour, values in ((2, first), (3, second)):
        _curve(dots, values, colour)
    return _tiff(dots)


def _graticule(dots: NDArray[np.uint8]) -> None:
    left, top, right, bottom = FRAME
    for share in np.linspace(0, 1, 11):
        dots[top : bottom + 1, round(left + share * (right - left))] = 1
        dots[round(top + share * (bottom - top)), left : right + 1] = 1


def _curve(dots: NDArray[np.uint8], values: Reals, colour: int) -> None:
    """Draw one trace, scaled to the graticule."""
    left, top, right, bottom = FRAME
    low, high = float(values.min()), float(values.max())
    share = (values - low) / (high - low) if high > low else np.full(values.shape, 0.5)
    x = np.arange(left, right + 1)
    y = np.interp(x, np.linspace(left, right, values.size), bottom - share * (bottom - top)).round().astype(int)
    for column, (a, b) in enumerate(zip(y, np.append(y[1:], y[-1]), strict=True)):
        dots[min(a, b) : max(a, b) + 1, x[column]] = colour


def _tiff(dots: NDArray[np.uint8]) -> bytes:
    """Return a baseline palette TIFF (TIFF 6.0, section 5) in one strip, big-endian like the instrument."""
    palette = np.zeros((256, 3), dtype=np.uint16)
    palette[: len(COLOURS)] = np.array(COLOURS) * 257
    entries = [
        (256, 4, 1, WIDTH),
        (257, 4, 1, HEIGHT),
        (258, 3, 1, 8 << 16),  # bits per pixel; short values are left-aligned in their field
        (259, 3, 1, 1 << 16),  # no compression
        (262, 3, 1, 3 << 16),  # palette
        (273, 4, 1, 0),  # strip offset, filled in below
        (278, 4, 1, HEIGHT),
        (279, 4, 1, dots.size),
        (320, 3, 768, 0),  # palette offset, filled in below
    ]
    data_at = 8 + 2 + 12 * len(entries) + 4
    offsets = {320: data_at, 273: data_at + 768 * 2}
    directory = struct.pack(">H", len(entries)) + b"".join(
        struct.pack(">HHII", tag, kind, count, offsets.get(tag, value)) for tag, kind, count, value in entries
    )
    return (
        b"MM\0*" + struct.pack(">I", 8) + directory + b"\0\0\0\0" + palette.T.astype(">u2").tobytes() + dots.tobytes()
    )
