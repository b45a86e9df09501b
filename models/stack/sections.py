"""From layers to sections: every layer at all frequencies, with the waves of all layers computed together."""

from collections.abc import Sequence

import numpy as np

from ..base.arrays import Complexes, Frequencies
from .acoustic_line import Line, one_minus_exp
from .active import ActiveLine
from .graded import slices_of
from .layers import Elastic, Piezo
from .lumps import Mass, Spring
from .network import Section

# glibc returns freed memory beyond 128 kB to the system, and the next evaluation pays a page fault for every 4 kB
# of it: more than all the arithmetic. Once a larger block was freed, glibc keeps that much (it is never touched, so it
# costs nothing); on other systems this line has no effect.
np.empty(16 << 20, np.uint8)


def sections_of(layers: Sequence[Elastic | Piezo | Spring | Mass], frequency: Frequencies) -> list[Section]:
    """Return the layers as sections at frequencies in Hz, shape (N,); a graded one has a section for each slice."""
    omega = 2 * np.pi * frequency
    jw = np.zeros(omega.shape, np.complex128)
    jw.imag = omega
    thin = [one for layer in layers for one in slices_of(layer)]
    lines = iter(_lines([one for one in thin if isinstance(one, Elastic | Piezo)], frequency, omega, jw))
    return [next(lines) if isinstance(one, Elastic | Piezo) else one.section(jw) for one in thin]


def _lines(layers: Sequence[Elastic | Piezo], frequency: Frequencies, omega: Frequencies, jw: Complexes) -> list[Line]:
    """Return the layers that carry waves as lines."""
    waves = [layer.wave(frequency) for layer in layers]
    dispersive = any(isinstance(delay, np.ndarray) for _, delay in waves)
    delays = np.empty((len(layers), frequency.size if dispersive else 1), np.complex128)
    for row, (_, delay) in zip(delays, waves, strict=True):
        row[:] = delay
    D = one_minus_exp(delays.imag * omega, 0.5 * delays.real * omega)
    b = D * (1.0 - 0.5 * D)
    result: list[Line] = []
    for k, (layer, (Zc, delay)) in enumerate(zip(layers, waves, strict=True)):
        if isinstance(layer, Elastic):
            result.append(Line(Zc, delay, jw, D[k], b[k]))
        else:
            per_jw = np.zeros(omega.shape, np.complex128)
            per_jw.imag = -1.0 / omega
            H = layer.field_per_strain(frequency) * per_jw
            W = layer.clamped_elastance(frequency) * per_jw
            result.append(ActiveLine(Zc, delay, jw, D[k], b[k], H, W, layer.h33 != 0))
    return result
