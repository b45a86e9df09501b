"""Wiring: whether another connection or polarity of several piezo layers would describe the recordings."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from ...models.base.errors import PzctlError
from ...models.build import Build
from ...models.sweep import Sweep
from ..engine.multi_step_fit import solve
from ..engine.recording import rms
from ..interface import FitTask

_WRONG, _BETTER = 0.05, 0.3
# RMS log error that missing physics does not leave, but a wrong wiring does; part of it that the right wiring leaves.
_POINTS = 200
# Points per recording: enough to tell two wirings apart.
_MOST = 4
# Piezo layers up to which all 2^n wirings are tried.


def wiring_doubts(task: FitTask, rms_log_error: float) -> tuple[str, ...]:
    """Return the sentence that names the wiring with which the recordings are described, if the build's is wrong."""
    build = task.build
    if build is None or not 1 < len(build.piezos) <= _MOST or rms_log_error < _WRONG:
        return ()
    few = {step: tuple(map(_thinned, sweeps)) for step, sweeps in task.sweeps.items()}
    for other in _others(build):
        try:
            solution = solve(replace(task, build=other, sweeps=few), lambda _: None)
        except PzctlError:
            continue
        left = rms(*solution.judged.log_ratios(solution.descent.x))
        if left < _BETTER * rms_log_error:
            return (
                f"The build says {_shown(build)}; with {_shown(other)} the RMS log error is {left:.2g} instead of "
                f"{rms_log_error:.2g}: check wiring and polarity.",
            )
    return ()


def _others(build: Build) -> Iterator[Build]:
    """Yield the build with every other wiring; the first layer keeps its polarity, since only differences matter."""
    first, *rest = build.piezos
    connections = (build.connection, "parallel" if build.connection == "series" else "series")
    for connection, polarities in product(connections, product((1, -1), repeat=len(rest))):
        signs = {first.name: first.polarity} | {
            layer.name: layer.polarity * turn for layer, turn in zip(rest, polarities, strict=True)
        }
        layers = tuple(replace(layer, polarity=signs.get(layer.name, 1)) for layer in build.layers)
        other = replace(build, layers=layers, connection=connection)
        if other != build:
            yield other


def _shown(build: Build) -> str:
    polarities: Iterable[str] = (f"{layer.polarity:+d}" for layer in build.piezos)
    return f"{build.connection}, polarity {' '.join(polarities)}"


def _thinned(sweep: Sweep) -> Sweep:
    every = slice(None, None, max(1, int(np.ceil(sweep.frequency.size / _POINTS))))
    return sweep.at(every)
