"""A fitter for pzctl: the capacitance of a transducer at the top of its sweep. See docs/writing-a-fitter.md."""

import time
from collections.abc import Callable

import numpy as np

from pzctl.fitters.interface import Constant, Curve, FitError, FitResult, FitTask, Noise


class Capacitance:
    """Capacitance and loss tangent of the last step, from the top tenth of its frequencies: Y = j w C (1 - j tan d)."""

    name, version = "capacitance", "1.0"
    summary = "capacitance and loss tangent at the top of the sweep"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Average Y/(j w). Raises FitError if there are too few points."""
        began = time.perf_counter()
        step, sweep = [(step, sweep) for step, found in task.sweeps.items() for sweep in found][-1]
        top = slice(-(len(sweep.frequency) // 10), None)
        f, Z = sweep.frequency[top], sweep.impedance[top]
        if len(f) < 3:
            raise FitError(f"step {step!r}: {len(sweep.frequency)} points; at least 30 are needed")
        each = 1 / (2j * np.pi * f * Z)
        C, spread = complex(each.mean()), float(each.std()) / len(f) ** 0.5
        u = spread / 2**0.5
        model = 1 / (2j * np.pi * f * C)
        ratio = np.log(model / Z)
        return FitResult(
            build=task.build.name if task.build else "",
            fitter=self.name,
            version=self.version,
            steps=(step,),
            noise=Noise(float(np.abs(ratio).std()), "smoothness"),
            chi2_per_dof=1.0,
            constants={"terminals.C": Constant(C.real, C.imag, u, u, "F")},
            derived={"terminals.tan_d": Constant(-C.imag / C.real, 0.0, u / C.real, None, "1")},
            correlation=(),
            rms_log_error=float(np.sqrt(np.mean(np.abs(ratio) ** 2))),
            converged=True,
            evaluations=1,
            seconds=time.perf_counter() - began,
            says=("an average over the top tenth of the sweep; chi2 per dof is 1 by construction",),
            curves=(Curve(step, f, Z, model, model),),
        )
