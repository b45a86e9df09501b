"""The error model as columns of d ln Z with unit normal prior: instrument, fixture, model constants, effects."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ...models.base.model import Approximate, Model
from ...models.effects import Device
from ...models.effects.base.corrected_path import SERIES, SHUNT
from ...models.effects.base.scale import active, capacitance, reactance, resonance
from ...models.stack import Elastic, Piezo, Stack
from ..engine.noise import common_settings
from ..engine.recording import Recording
from . import prior_scales as scales
from .instrument_share import accuracy_of
from .local_error_kinds import LocalError, RangeSwitch, WeakLine
from .point_covariance import PointErrors
from .smooth_basis import ends_of, smooth

Part = str
"""Part of the error of a column.

`slow`, `fast`, `switch`, `fixture`, `held`, `tau`, `imaginary`, `losses`, `uneven`, `shape`, `line`, or `formula`: the
known error of an approximate model.
"""


_SHOWS = 1.0
"""Change of chi2 by the error of a formula from which that counts: less is no evidence of anything."""
HELD = "held:"
"""Prefix of the correction of a value held as exact."""


@dataclass(frozen=True, eq=False)
class HeldValue:
    """A value held as exact that may be off by its tolerance."""

    name: str
    relative: float
    """Its tolerance."""
    columns: tuple[Complexes, ...]
    """d ln Z per tolerance in each recording, shape (N,)."""


@dataclass(frozen=True, eq=False)
class ColumnCorrection:
    """The correction of a constant, of a held value or of the path that a column of unit coefficient stands for."""

    name: str
    """Constant, `disk.c33D`; `series` or `shunt`; a held value behind `held:`."""
    relative: tuple[Complexes, ...]
    """For each recording, shape (N,); of the path in ohm or siemens."""


@dataclass(frozen=True, eq=False)
class ErrorColumns:
    """The columns at one point of a fit."""

    parts: tuple[Part, ...]
    """Part of each column, shape (C,)."""
    losses: Reals
    """For columns of an imaginary part: change of that loss over the band, shape (C,)."""
    blocks: tuple[Complexes, ...]
    """For each recording, d ln Z per unit of each column's scale, shape (N, C)."""
    points: tuple[PointErrors, ...]
    corrections: "tuple[ColumnCorrection | None, ...]" = ()
    """Correction of a constant that a column is the effect of, for each column."""
    absorbed: tuple[Complexes, ...] = ()
    """What corrections that the model contains change in ln Z to first order, for each recording, shape (N,)."""
    means: "Mapping[str, Reals]" = field(default_factory=dict[str, Reals])
    """Mean of the smooth functions over each constant's sensitivity, which belongs to the constant, shape (K,)."""

    def beyond(self, r: Sequence[Complexes]) -> list[Complexes]:
        """Return residuals of the corrected model as those of the uncorrected one, to first order."""
        return [own - part for own, part in zip(r, self.absorbed, strict=True)] if self.absorbed else list(r)

    def present(self, sizes: Mapping[Part, float]) -> tuple[NDArray[np.intp], Reals]:
        """Return indices of the columns that are there at these sizes, and standard deviations of their coefficients.

        Each of shape (P,); those of the prior.
        """
        kinds, which, free = self._kinds
        plain: Reals = np.array([sizes[part] if part != "imaginary" else 0.0 for part in kinds])[which]
        both = np.hypot(scales.IMAGINARY * sizes["tau"], self.losses * sizes["losses"])
        scale = np.asarray(plain + free * both, np.float64)
        on = np.flatnonzero(scale > 0)
        return on, scale[on]

    @cached_property
    def _kinds(self) -> tuple[tuple[Part, ...], NDArray[np.intp], Reals]:
        """Kinds of parts, for each column which of them it is, and 1 where it is imaginary, shape (C,)."""
        kinds = tuple(dict.fromkeys(self.parts))
        which = np.array([kinds.index(part) for part in self.parts], np.intp)
        return kinds, which, np.array([part == "imaginary" for part in self.parts], dtype=np.float64)

    def only(self, on: NDArray[np.intp]) -> "ErrorColumns":
        """Return the columns with these indices."""
        parts = tuple(self.parts[int(k)] for k in on)
        blocks = tuple(b[:, on] for b in self.blocks)
        own = tuple(self.corrections[int(k)] for k in on) if self.corrections else ()
        return replace(self, parts=parts, losses=self.losses[on], blocks=blocks, corrections=own)


@dataclass(frozen=True, eq=False)
class LinearisedRecording:
    """A recording with the impedance and the derivatives of its model."""

    recording: Recording
    Z: Impedances
    felt: Mapping[str, Complexes]
    """d ln Z / d ln constant, complex, by constant (`disk.c33D`), shape (N,)."""
    losses: Mapping[str, float]
    """Loss tangent of the same constants."""
    shapes: Mapping[str, Complexes]
    """d ln Z / d ln size of each effect, shape (N,)."""
    rough: Sequence[Complexes]
    """Those of effects whose formulas have rough errors, too."""
    formula: Mapping[str, Complexes]
    """d ln Z per standard error that the model's formula has in these constants, shape (N,); of an exact one none."""
    in_series: Impedances | float = 0.0
    """What the path that the model contains has in series, shape (N,)."""

    def path_slope(self, name: str) -> Complexes:
        """Return d ln Z per ohm in series, or per siemens across the device, shape (N,)."""
        return _complex(1 / self.Z if name == SERIES else -((self.Z - self.in_series) ** 2) / self.Z)


def stack_of(model: Model) -> Stack:
    """Return the stack that sets the scales of a device, or the stack itself."""
    stack = model.reference if isinstance(model, Device) else model
    if not isinstance(stack, Stack):
        raise TypeError(f"no stack in {type(stack).__name__}")
    return stack


def place_of(
    recording: Recording,
    shapes: Mapping[str, Complexes],
    rough: Sequence[Complexes],
    in_series: Impedances | float = 0.0,
) -> LinearisedRecording:
    """Return a recording with the derivatives of its model, which has the values of the fit."""
    model, f = recording.model, recording.sweep.frequency
    bare = model.bare if isinstance(model, Device) else model
    names = _of_layers(bare) if isinstance(bare, Stack) else _of_parameters(bare)
    Z, slopes = model.jacobian(f, [parameter for _, parameter, _, _ in names])
    felt = {name: slope * value for (name, _, value, _), slope in zip(names, slopes, strict=True)}
    whole = model.assembly.whole if isinstance(model, Device) else model  # with all that lies on its faces
    errors: Mapping[str, Reals] = whole.formula_errors(f) if isinstance(whole, Approximate) else {}
    formula = {name: felt[name] * error for name, error in errors.items() if name in felt}
    losses = {name: loss for name, _, _, loss in names}
    return LinearisedRecording(recording, Z, felt, losses, shapes, rough, formula, in_series)


_Names = list[tuple[str, str, complex, float]]
"""Name, parameter, value and loss tangent of each constant."""


def _of_layers(stack: Stack) -> _Names:
    """Return the constants of a stack's layers."""
    names: _Names = []
    for layer in stack.layers:
        own = layer.name
        if isinstance(layer, Piezo):
            values = {"c33D": layer.c33D, "h33": layer.h33, "eps33S": layer.eps33S}
            losses = {"c33D": layer.c33D.imag / layer.c33D.real, "eps33S": -layer.eps33S.imag / layer.eps33S.real}
            names += [(f"{own}.{k}", f"{own}.{k}.re", v, losses.get(k, 0.0)) for k, v in values.items()]
        elif isinstance(layer, Elastic):
            names += [(f"{own}.z", f"{own}.z", complex(layer.z), 1 / layer.q)]
            names += [(f"{own}.c", f"{own}.c", complex(layer.c), 1 / layer.q)]
    return names


def _of_parameters(model: Model) -> _Names:
    """Return the complex constants of a model; of one that has none, such as a circuit, all that it has."""
    own = model.parameters()
    complexes = [name.removesuffix(".im") for name in own if name.endswith(".im")]
    if not complexes:
        return [(name, name, complex(value), 0.0) for name, value in own.items() if value]
    values = {name: complex(own[f"{name}.re"], own[f"{name}.im"]) for name in complexes}
    return [(name, f"{name}.re", value, abs(value.imag / value.real)) for name, value in values.items() if value.real]


def columns_of(
    places: Sequence[LinearisedRecording],
    held: Sequence[HeldValue],
    local: Sequence[LocalError] = (),
    *,
    means: Mapping[str, Reals] | None = None,
    in_time: Collection[str] = (),
) -> ErrorColumns:
    """Return all columns over all recordings of a session, which has one instrument and one fixture.

    `means`: those of the smooth functions where a fit began, so that a coefficient means the same in all of it.
    `in_time`: shapes whose errors are smooth in time.
    """
    ends = ends_of([np.log(place.recording.sweep.frequency[[0, -1]]) for place in places])
    parts: list[Part] = []
    of_losses: list[float] = []
    made: list[list[Complexes]] = [[] for _ in places]
    corrections: list[ColumnCorrection | None] = []

    def add(
        part: Part,
        loss: float,
        column: Callable[[LinearisedRecording], Complexes],
        correction: ColumnCorrection | None = None,
    ) -> None:
        parts.append(part)
        of_losses.append(loss)
        corrections.append(correction)
        for own, place in zip(made, places, strict=True):
            own.append(column(place))

    def grid(length: float, most: int) -> list[Reals]:
        return [smooth(np.log(place.recording.sweep.frequency), ends, length, most) for place in places]

    _instrument(add, places, grid)
    _fixture(add, places)
    centres = _constants(add, places, grid(scales.LENGTH, scales.FEW_SMOOTH), means or {})
    _uneven(add, places)
    _formula(add, places, grid(scales.LENGTH, scales.FEW_SMOOTH))
    centres |= _shapes(add, places, grid(scales.SHAPE_LENGTH, scales.FEW_SHAPE), means or {}, in_time)
    for one in held:
        of = _at(places, one.columns)
        everywhere = tuple(np.full(place.Z.size, complex(one.relative)) for place in places)
        add("held", 0.0, lambda p, of=of: of[id(p)], ColumnCorrection(HELD + one.name, everywhere))
    _lines(add, places, [one for one in local if isinstance(one, WeakLine)])
    _switches(add, places, [one for one in local if isinstance(one, RangeSwitch)])
    blocks = tuple(np.array(own).T for own in made)  # column by column, as what is computed with them takes them
    points = tuple(_points(place) for place in places)
    return ErrorColumns(tuple(parts), np.array(of_losses), blocks, points, tuple(corrections), means=centres)


class _Add(Protocol):
    def __call__(
        self,
        part: Part,
        loss: float,
        column: Callable[[LinearisedRecording], Complexes],
        correction: ColumnCorrection | None = None,
        /,
    ) -> None: ...


_Grid = Callable[[float, int], list[Reals]]


_Values = TypeVar("_Values", Reals, Complexes)


def _at(places: Sequence[LinearisedRecording], functions: Sequence[_Values]) -> dict[int, _Values]:
    return {id(place): own for place, own in zip(places, functions, strict=True)}


def _instrument(add: _Add, places: Sequence[LinearisedRecording], grid: _Grid) -> None:
    """Add gain and phase errors, slow and fast, common to all sweeps."""
    accuracies = [accuracy_of(place.recording.sweep)[:, None] for place in places]
    for part, length, most in scales.OF_INSTRUMENT:
        errors = [size * own for size, own in zip(accuracies, grid(length, most), strict=True)]
        of = _at(places, errors)
        for k in range(errors[0].shape[1]):
            for unit in (1.0, 1j):
                add(part, 0.0, lambda p, of=of, k=k, unit=unit: _complex(unit * of[id(p)][:, k]))


def _switches(add: _Add, places: Sequence[LinearisedRecording], switches: Sequence[RangeSwitch]) -> None:
    """Add the steps of gain and phase where the analyzer changes its range, in all sweeps the same."""
    for one in switches:
        for unit in (1.0, 1j):
            add("switch", 0.0, lambda p, one=one, unit=unit: _complex(unit * one.step_of(p.recording)))


def switch_columns(recording: Recording, switch: RangeSwitch) -> Complexes:
    """Return the columns of a switch of the range in a recording, of gain and of phase, shape (N, 2)."""
    step = _complex(switch.step_of(recording))
    return np.stack([step, 1j * step], axis=1)


def _fixture(add: _Add, places: Sequence[LinearisedRecording]) -> None:
    """Add the residual of the compensation: a series impedance and a shunt admittance."""
    laws: dict[str, tuple[str, Callable[[Frequencies], Complexes]]] = {
        "inductance": (SERIES, j_omega),
        "resistance": (SERIES, lambda f: _complex(np.ones(f.size))),
        "skin": (SERIES, lambda f: _complex((1 + 1j) * np.sqrt(f / 1e6))),
        "capacitance": (SHUNT, j_omega),
        "conductance": (SHUNT, lambda f: _complex(np.ones(f.size))),
    }
    for name, (part, law) in laws.items():
        own = tuple(scales.FIXTURE[name] * law(p.recording.sweep.frequency) for p in places)
        _correction(add, "fixture", 0.0, places, _path_slopes(part, places), ColumnCorrection(part, own))


def _path_slopes(name: str, places: Sequence[LinearisedRecording]) -> list[Complexes]:
    """Return d ln Z per ohm in series, or per siemens across the device, in each recording, shape (N,)."""
    return [p.path_slope(name) for p in places]


def _constants(
    add: _Add, places: Sequence[LinearisedRecording], functions: Sequence[Reals], known: Mapping[str, Reals]
) -> dict[str, Reals]:
    """Add smooth errors of every constant, of a series impedance and of a shunt; and separate ones of the losses.

    Return the means of the functions, those that are `known` as they are.
    """
    means: dict[str, Reals] = {}
    names = list(dict.fromkeys(name for place in places for name in place.felt))
    stack = stack_of(places[-1].recording.model)
    z0, f0 = reactance(stack), resonance(stack)
    slopes: dict[str, list[Complexes]] = {
        name: [p.felt.get(name, np.zeros(p.Z.size, np.complex128)) for p in places] for name in names
    }
    units = dict.fromkeys(names, 1.0) | {SERIES: z0, SHUNT: 1 / z0}
    for name in (SERIES, SHUNT):
        slopes[name] = _path_slopes(name, places)
    for name, own in slopes.items():
        means[name] = known[name] if name in known else _mean(functions, own)
        centred = [b - means[name] for b in functions]
        loss = next((p.losses[name] for p in places if name in p.losses), 0.0)
        kind = name.rpartition(".")[2]
        own_loss = (
            scales.LOSSES.get(kind, 0.4) * (loss if kind != "h33" else _loss_of(places, name))
            if loss or kind == "h33"
            else 0
        )
        few = centred[0].shape[1] if name in names else min(scales.FEW_PATH, centred[0].shape[1])
        for k in range(few):
            real = ColumnCorrection(name, tuple(_complex(units[name] * one[:, k]) for one in centred))
            imaginary = ColumnCorrection(name, tuple(1j * one for one in real.relative))
            _correction(add, "tau", 0.0, places, own, real)
            _correction(add, "imaginary", own_loss, places, own, imaginary)
        if kind in ("eps33S", "eps33T"):
            falls = tuple(_complex(scales.FALL * np.log(p.recording.sweep.frequency / f0)) for p in places)
            _correction(add, "losses", 0.0, places, own, ColumnCorrection(name, falls))
    return means


def _uneven(add: _Add, places: Sequence[LinearisedRecording]) -> None:
    """Add what an uneven thickness of each ceramic does: in all recordings the same."""
    names = dict.fromkeys(
        layer.name for p in places for layer in stack_of(p.recording.model).layers if isinstance(layer, Piezo)
    )
    for name in names:
        add("uneven", 0.0, lambda p, name=name: _unevenness(p.recording, name))


def _unevenness(recording: Recording, name: str) -> Complexes:
    """Return the change of ln Z by an uneven thickness of a ceramic, shape (N,)."""
    model = recording.model
    device = model if isinstance(model, Device) else Device(model)
    return device.unevenness(recording.sweep.frequency, name, scales.UNEVEN)


def _correction(
    add: _Add,
    part: Part,
    loss: float,
    places: Sequence[LinearisedRecording],
    slopes: Sequence[Complexes],
    one: ColumnCorrection,
) -> None:
    """Add the correction of a constant; `slopes`: d ln Z / d ln constant in each recording, shape (N,)."""
    of = _at(places, [slope * relative for slope, relative in zip(slopes, one.relative, strict=True)])
    add(part, loss, lambda p: of[id(p)], one)


def _complex(values: Reals | NDArray[np.complexfloating]) -> Complexes:
    return np.asarray(values, np.complex128)


def _loss_of(places: Sequence[LinearisedRecording], name: str) -> float:
    layer = name.partition(".")[0]
    return next((p.losses[f"{layer}.c33D"] for p in places if f"{layer}.c33D" in p.losses), 0.0)


def _mean(functions: Sequence[Reals], weights: Sequence[Complexes]) -> Reals:
    """Return the mean of each function, weighted by sensitivity, shape (K,)."""
    total = sum(float(np.sum(np.abs(w) ** 2)) for w in weights)
    mean = np.zeros(functions[0].shape[1])
    if total <= 0:
        return mean
    return sum(((np.abs(w) ** 2) @ b for b, w in zip(functions, weights, strict=True)), mean) / total


def _shapes(
    add: _Add,
    places: Sequence[LinearisedRecording],
    functions: Sequence[Reals],
    known: Mapping[str, Reals],
    in_time: Collection[str],
) -> dict[str, Reals]:
    """Add smooth errors of the effects' own formulas; a course in time has real ones.

    Real ones have mean zero, weighted by sensitivity: an error of the whole formula by one factor is another size of
    the effect. Return the means of the functions, those that are `known` as they are.
    """
    means: dict[str, Reals] = {}
    over_time = _over_time(places) if in_time else functions
    for name in dict.fromkeys(name for place in places for name in place.shapes):
        slopes = [p.shapes.get(name, np.zeros(p.Z.size, np.complex128)) for p in places]
        smooth_in, units = (over_time, (1.0,)) if name in in_time else (functions, (1.0, 1j))
        means[name] = known[name] if name in known else _mean(smooth_in, slopes)
        own, by = _at(places, [scales.SHAPE * slope for slope in slopes]), _at(places, smooth_in)
        for k in range(smooth_in[0].shape[1]):
            for unit in units:
                centre = float(means[name][k]) if unit == 1.0 else 0.0
                add(
                    "shape",
                    0.0,
                    lambda p, k=k, unit=unit, own=own, by=by, centre=centre: (
                        unit * own[id(p)] * (by[id(p)][:, k] - centre)
                    ),
                )
    return means


def _over_time(places: Sequence[LinearisedRecording]) -> list[Reals]:
    """Return smooth functions of ln(1 + time in sweeps) for each recording of a device, shape (N, K)."""
    devices = [(p.recording.model, p.Z.size) for p in places]
    times = [np.log1p(own.conditions.elapsed(n)) if isinstance(own, Device) else np.zeros(n) for own, n in devices]
    ends = float(min(np.min(t) for t in times)), float(max(np.max(t) for t in times))
    return [smooth(t, ends, scales.SHAPE_LENGTH, scales.FEW_SHAPE) for t in times]


def _formula(add: _Add, places: Sequence[LinearisedRecording], functions: Sequence[Reals]) -> None:
    """Add what approximate models neglect, unless it is less than the recordings can show."""
    of = _at(places, functions)
    for name in dict.fromkeys(name for place in places for name in place.formula):
        in_noise = [np.abs(p.formula[name] / p.recording.noise) for p in places if name in p.formula]
        if sum(float(np.sum(own**2)) for own in in_noise) < _SHOWS:
            continue
        for k in range(functions[0].shape[1]):
            add("formula", 0.0, lambda p, name=name, k=k: _complex(p.formula.get(name, 0.0) * of[id(p)][:, k]))


def _lines(add: _Add, places: Sequence[LinearisedRecording], lines: Sequence[WeakLine]) -> None:
    """Add the residues of weak lines, and the errors of their frequencies and Q."""
    for line in lines:
        for made in (line.admittance, line.shifted):
            own = [_in_its_step(p.recording, line, made) for p in places]
            for unit in (1.0, 1j):
                one = ColumnCorrection(SHUNT, tuple(_complex(unit * Y) for Y in own))
                _correction(add, "line", 0.0, places, _path_slopes(SHUNT, places), one)


def _in_its_step(recording: Recording, line: WeakLine, made: Callable[[Frequencies, float], Complexes]) -> Complexes:
    """Return what a weak line makes in a recording, shape (N,); zero in another step's."""
    if recording.step != line.step:
        return np.zeros(recording.sweep.frequency.size, np.complex128)
    return made(recording.sweep.frequency, capacitance(stack_of(recording.model)))


def line_columns(recording: Recording, Z: Impedances, line: WeakLine) -> Complexes:
    """Return the columns of a weak line in a recording, in phase and in quadrature, shape (N, 2)."""
    change = -Z * _in_its_step(recording, line, line.admittance)
    return np.stack([change, 1j * change], axis=1)


def _points(place: LinearisedRecording) -> PointErrors:
    stack = stack_of(place.recording.model)
    disk = f"{active(stack).name}."
    names = [name for name in place.felt if name.startswith(disk)] or list(place.felt)
    squares = sum((np.abs(place.felt[name]) ** 2 for name in names), np.zeros(place.Z.size))
    felt = np.sqrt(scales.ROUGH_FLOOR**2 + squares)
    bent = np.sqrt(sum((np.abs(own) ** 2 for own in place.rough), np.zeros(place.Z.size)))
    own = place.recording
    # what an effect does depends on the level and the direction of a sweep, and so do errors of its formula
    device = f"{own.step} {common_settings(own.sweep)}"
    return PointErrors(np.log(own.sweep.frequency), own.noise, felt, bent, own.colour_limit, device)
