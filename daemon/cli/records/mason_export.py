"""The fitted stack of a measured step as a SPICE netlist of transmission lines."""

from pathlib import Path

import numpy as np

from ....drivers.recordings.atomic_file import write_whole
from ....fitters.engine.parameters.assembly import stack_of
from ....fitters.interface import FitResult
from ....models.base.errors import CannotError
from ....models.build import Build
from ....models.circuits.mason_netlist import as_circuit, mason_netlist, reference_of
from ....models.stack.stack import Stack
from ...samples.sample_record import StepRecord


class NoStackFitError(CannotError):
    """A step has no fit of its stack."""


def fitted_stack(build: Build, step: str, result: FitResult) -> Stack | None:
    """Return the stack of a step with the values of a fit, or None if it is no fit of every layer."""
    stack = stack_of(build, build.step(step))
    values = {name: constant.re for name, constant in result.constants.items()}
    for name, constant in result.constants.items():
        values |= {f"{name}.re": constant.re, f"{name}.im": constant.im}
    for layer, (ground_at, _) in build.reground(step).items():
        ground = result.constants.get(f"{layer}.thickness@{ground_at}")
        values |= {f"{layer}.thickness": ground.re} if ground else {}
    layers = {layer.name for layer in stack.layers}
    if not layers <= {name.partition(".")[0] for name in result.constants}:
        return None
    return stack.replace({name: value for name, value in values.items() if name in stack.names})


def write_mason(build: Build, record: StepRecord, path: Path) -> None:
    """Write the netlist of a step's stack, with the values of its first fit of a stack.

    Raises NoStackFitError, NetlistError, RecordingError.
    """
    step = record.measurement.sample.step
    fits = ((result, fitted_stack(build, step, result)) for result in record.fits)
    result, stack = next(((one, found) for one, found in fits if found is not None), (None, None))
    if result is None or stack is None:
        raise NoStackFitError(f"step {step!r} has no fit of its layers to write; `pzctl fit --all` makes one")
    at, circuit = reference_of(stack), as_circuit(stack)
    errors = [np.log(circuit.impedance(sweep.frequency) / sweep.impedance) for sweep in record.sweeps]
    rms = float(np.sqrt(np.mean(np.abs(np.concatenate(errors)) ** 2)))
    low, high = (edge(edge(sweep.frequency) for sweep in record.sweeps) / 1e6 for edge in (min, max))
    comments = (
        f"{path.stem}: layers as lossy transmission lines, constants of the fit by {result.fitter} {result.version}",
        f"exact at {at / 1e6:.4g} MHz; away from it losses differ: SPICE has none that is the same at all frequencies",
        f"relative error of Z from {low:.4g} to {high:.4g} MHz: {rms:.2g} (rms)",
        *(f"without {effect.effect}, which the build states" for effect in build.effects),
    )
    write_whole(path, mason_netlist(stack, path.stem, comments).encode())
