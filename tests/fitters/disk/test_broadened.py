"""Broadened recordings, compared with the analytic continuation of a sum of resonances."""

import numpy as np

from pzctl.fitters.disk.two_d.broadened import broadened
from pzctl.fitters.engine.recording import Recording
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.sweep import Sweep


def test_a_broadened_recording_is_that_of_a_device_with_more_loss():
    f = np.linspace(0.7e6, 1.3e6, 1201)
    resonances, Q = ((0.9e6, 1.5e-10), (1.05e6, 1e-10)), 250
    circuit = Lumped(1e-9, tuple(Branch.from_resonance(at, Q, C) for at, C in resonances))
    seen = broadened(Recording("disk", Sweep(f, circuit.impedance(f)), circuit, np.full(f.size, 1e-4)))
    lower = f * (1 - 0.0125j / 2)
    C = 1e-9 + sum(C1 / (1 - (lower / at) ** 2 + 1j * lower / at / Q) for at, C1 in resonances)
    off = np.abs(1 / (2j * np.pi * f * seen.sweep.impedance) / C - 1)
    assert np.all(off < 2 * seen.noise)
    inside = (f > 0.8e6) & (f < 1.2e6)
    assert np.median(off[inside]) < 0.02 < 0.5 < np.max(seen.noise)
    sharp = np.abs(1 / (2j * np.pi * f * circuit.impedance(f)) / C - 1)
    assert np.max(sharp[inside]) > 15 * np.max(off[inside])
