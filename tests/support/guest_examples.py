"""Fitters for the tests: one that answers, one that refuses, one that crashes, one that answers nonsense."""

import os
import signal
import time
from collections.abc import Callable

from pzctl.fitters.interface import Constant, Curve, FitError, FitResult, FitTask, Noise


def _result(task: FitTask, name: str, chi2: float = 1.0) -> FitResult:
    sweeps = [(step, sweep) for step, found in task.sweeps.items() for sweep in found]
    return FitResult(
        build=task.build.name if task.build else "",
        fitter=name,
        version="1",
        steps=tuple(task.sweeps),
        noise=Noise(1e-3, "smoothness"),
        chi2_per_dof=chi2,
        constants={"disk.Z": Constant(float(abs(sweeps[-1][1].impedance[0])), 0.0, 1.0, None, "ohm")},
        derived={},
        correlation=(("a", "b", -0.9),),
        rms_log_error=0.1,
        converged=True,
        evaluations=3,
        seconds=0.01,
        curves=tuple(Curve(step, s.frequency, s.impedance, 2 * s.impedance, 3 * s.impedance) for step, s in sweeps),
    )


class Echo:
    """Returns its input."""

    name = "echo"
    version = "1"
    summary = "the first impedance, and curves that are multiples of what was measured"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        return _result(task, self.name)


class Refuses(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        raise FitError("recording 'x': no resonance between 1 and 2 MHz; sweep wider")


class Fails(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        raise ZeroDivisionError("oh")


class Dies(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        os._exit(7)


class Nonsense(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        return _result(task, self.name, chi2=float("nan"))


class Hangs(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
        while True:
            time.sleep(1)


class Leaks(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        kept = [bytearray(64 << 20) for _ in range(1000)]
        return _result(task, str(len(kept)))


class Chatters(Echo):
    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        for _ in range(100):
            print("x" * (1 << 20))
        return _result(task, self.name)
