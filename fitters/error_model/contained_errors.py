"""What a model contains of the errors: corrections of its layers, of the path, and of values that are held."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Complexes, Reals
from ...models.base.model import Model
from ...models.effects import Device
from ...models.effects.base.corrected_constants import Corrections, corrected_in
from ...models.effects.base.corrected_path import PATH, PathCorrection
from ...models.effects.polarity import Polarity
from ...models.stack import Stack
from ..engine.recording import Recording
from .error_columns import HELD, ErrorColumns

_FURTHEST = 1.5
"""Largest correction of the logarithm of a held value; a trial step that asks for more is a bad one."""

_Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class _Sampled:
    """Corrections of some constants at the points of some recordings, per unit of each column's coefficient."""

    log_f: Reals
    """Increasing, shape (K,)."""
    of: dict[str, tuple[_Indices, Complexes]]
    """By name: its columns, shape (n,), and their corrections, shape (K, n)."""

    @classmethod
    def of_columns(
        cls, recordings: Sequence[Recording], which: Sequence[int], columns: ErrorColumns, names: Sequence[str]
    ) -> Self:
        """Return what columns correct of constants at the points of the recordings with these numbers."""
        log_f = np.concatenate([np.log(recordings[k].sweep.frequency) for k in which])
        points, first = np.unique(log_f, return_index=True)
        of: dict[str, tuple[_Indices, Complexes]] = {}
        for name in names:
            own = {k: one.relative for k, one in enumerate(columns.corrections) if one is not None and one.name == name}
            if own:
                parts = [np.concatenate([relative[k] for k in which])[first] for relative in own.values()]
                of[name] = np.array(list(own), np.intp), np.stack(parts, axis=1)
        return cls(points, of)

    def at(self, a: Reals) -> dict[str, Complexes]:
        """Return the corrections by name, shape (K,), with coefficients of the columns, shape (C,)."""
        return {name: per @ a[own] for name, (own, per) in self.of.items() if np.any(a[own])}


class ContainedErrors:
    """Corrections of the models of recordings for given columns of errors; the rest is added to first order.

    Layers of stacks are corrected, the path to the device, and held values; not the constants of other models, nor the
    path of a recording that is inverted or conjugated.
    """

    def __init__(self, recordings: Sequence[Recording], columns: ErrorColumns) -> None:
        layers = sorted({name for one in recordings for name in layers_corrected(one.model)})
        everything = range(len(recordings))
        self._layers = _Sampled.of_columns(recordings, everything, columns, layers)
        self._paths: dict[str, _Sampled] = {}
        for step in dict.fromkeys(one.step for one in recordings):
            own = [k for k, one in enumerate(recordings) if one.step == step and not altered(one.model)]
            if own:
                self._paths[step] = _Sampled.of_columns(recordings, own, columns, PATH)
        names = ["" if one is None else one.name for one in columns.corrections]
        self._held = {name.removeprefix(HELD): k for k, name in enumerate(names) if name.startswith(HELD)}
        self._tolerances = [0.0 if one is None else float(one.relative[0][0].real) for one in columns.corrections]
        self.there: NDArray[np.bool_] = np.array(
            [name in layers or name in PATH or name.startswith(HELD) for name in names], dtype=bool
        )
        """Whether the model contains what each column stands for, shape (C,)."""
        of_path = np.array([name in PATH for name in names], dtype=bool)
        left = [np.flatnonzero(~self.there | (of_path & altered(one.model))) for one in recordings]
        self._rest = [(own, block[:, own]) for own, block in zip(left, columns.blocks, strict=True)]

    def corrections(self, a: Reals) -> Corrections | None:
        """Return what coefficients of the columns, shape (C,), correct; None for nothing."""
        relative = self._layers.at(a)
        paths = {step: PathCorrection(own.log_f, values) for step, own in self._paths.items() if (values := own.at(a))}
        held = {
            name: float(np.clip(a[k] * self._tolerances[k], -_FURTHEST, _FURTHEST))
            for name, k in self._held.items()
            if a[k]
        }
        return Corrections(self._layers.log_f, relative, paths, held) if relative or paths or held else None

    def with_rest(self, r: Sequence[Complexes], a: Reals) -> list[Complexes]:
        """Return residuals of the corrected model with what it does not contain, to first order, shape (N,)."""
        return [own + block @ a[left] if left.size else own for own, (left, block) in zip(r, self._rest, strict=True)]


def layers_corrected(model: Model) -> list[str]:
    """Return the constants of a model's layers that can be corrected."""
    bare = model.bare if isinstance(model, Device) else model
    return [name for layer in bare.layers for name in corrected_in(layer)] if isinstance(bare, Stack) else []


def altered(model: Model) -> bool:
    """Return whether a recording is inverted or conjugated: nothing can be added to its path as to that of a device."""
    return isinstance(model, Device) and any(isinstance(one.effect, Polarity) for one in model.added)
