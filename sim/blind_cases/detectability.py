"""How visible a plant is: the chi2 that stays when all free constants have done what they can to imitate it.

The constants that a fitter frees are moved here on noise-free recordings of this world's own, by Gauss and Newton's
steps with derivatives from finite differences. What stays is the gain in chi2 that naming the plant can bring.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .device_under_test import AIR, BondedLayer, DeviceUnderTest
from .injected_effect import InjectedEffect, Scenario
from .recording_process import SweepSpec, record
from .waves import Complexes, Reals

_BACKED = 1e6
"""Rayl from which a load is a backing."""
_ROUNDS = 8
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class AbsorbedFit:
    """The best that the free constants can do without a plant."""

    gain: float
    """chi2 that stays."""
    specimen: DeviceUnderTest
    """The biased constants."""


def imitate(hideout: Scenario, index: int, takes: Sequence[SweepSpec]) -> AbsorbedFit:
    """Return the fit without plant number `index`, the sizes of all other plants free."""
    without = hideout.without(index)
    target = [np.log(record(hideout.specimen, hideout.hidden(take.step), take)) for take in takes]
    others = [k for k, plant in enumerate(hideout.plants) if k != index and plant.least < plant.most]
    coats = [k for k, coat in enumerate(hideout.specimen.coats) if coat.name not in hideout.untold]
    size = 8 + sum(1 if hideout.specimen.coats[k].glue else 3 for k in coats) + len(others)

    def world(x: Reals) -> Scenario:
        specimen = moved(hideout.specimen, x[: size - len(others)], coats)
        plants: list[InjectedEffect] = list(without.plants)
        for k, change in zip(others, x[size - len(others) :], strict=True):
            plants[k] = replace(plants[k], scale=plants[k].scale * (1 + change))
        return Scenario(specimen, tuple(plants))

    def residual(x: Reals) -> Reals:
        here = world(x)
        rows = [
            _row(record(here.specimen, here.hidden(take.step), take), wanted, take)
            for take, wanted in zip(takes, target, strict=True)
        ]
        return np.concatenate([*rows, _priors(here.specimen, coats)])

    x, chi2 = _descend(residual, np.zeros(size))
    return AbsorbedFit(chi2, world(x).specimen)


def sized(hideout: Scenario, index: int, takes: Sequence[SweepSpec], gain: float) -> tuple[Scenario, AbsorbedFit]:
    """Return the hideout with plant `index` as large as it takes to be visible with `gain`, within physical limits."""
    best, seen, power = hideout, imitate(hideout, index, takes), 2.0
    for _ in range(5):
        plant = best.plants[index]
        if plant.least >= plant.most or 0.7 < seen.gain / gain < 1.4:
            break
        factor = float(np.clip((gain / max(seen.gain, 1e-6)) ** (1 / power), 0.02, 50.0))
        scaled = plant.at(plant.scale * factor)
        if scaled.scale == plant.scale:
            break
        best = replace(best, plants=tuple(scaled if k == index else one for k, one in enumerate(best.plants)))
        before, seen = seen, imitate(best, index, takes)
        # most effects are felt in proportion, some (a spread of thickness) by their square: chi2 tells which
        felt = np.log(max(seen.gain, 1e-9) / max(before.gain, 1e-9)) / np.log(scaled.scale / plant.scale)
        power = float(np.clip(felt, 1.0, 5.0))
    return best, seen


def moved(specimen: DeviceUnderTest, x: Reals, coats: Sequence[int]) -> DeviceUnderTest:
    """Return the specimen with its constants changed: relative changes of the disk's, the air's, the free coats'."""
    disk = replace(
        specimen.disk,
        c33D=specimen.disk.c33D * (1 + complex(x[0], x[1])),
        h33=specimen.disk.h33 * (1 + complex(x[2], x[3])),
        eps33S=specimen.disk.eps33S * (1 + complex(x[4], x[5])),
    )
    air = [AIR * max(1 + float(change), 0.0) for change in x[6:8]]
    all_coats, at = list(specimen.coats), 8
    for k in coats:
        coat = all_coats[k]
        if coat.glue:
            all_coats[k] = replace(coat, thickness=coat.thickness * float(np.exp(np.clip(x[at], -3, 3))))
            at += 1
        else:
            all_coats[k] = _moved_coat(coat, x[at : at + 3])
            at += 3
    back = air[0] if specimen.back == AIR else specimen.back
    return replace(specimen, disk=disk, coats=tuple(all_coats), back=back, front=air[1])


def _moved_coat(coat: BondedLayer, x: Reals) -> BondedLayer:
    z, c, q = coat.z * (1 + float(x[0])), coat.c * (1 + float(x[1])), coat.q * float(np.exp(np.clip(x[2], -3, 3)))
    return replace(coat, z=z, c=c, q=q)


def _row(z: Complexes, wanted: Complexes, take: SweepSpec) -> Reals:
    difference = np.log(z) - wanted
    wrapped = difference.real + 1j * ((difference.imag + np.pi) % (2 * np.pi) - np.pi)
    sigma = take.noise + 5e-6 / np.abs(z)
    return np.concatenate([wrapped.real / sigma, wrapped.imag / sigma])


def _priors(specimen: DeviceUnderTest, coats: Sequence[int]) -> Reals:
    """Return how far coats and air are from what is known of them, in its uncertainties, as far as it matters.

    A face in a jig feels anything from nothing upwards: air counts as known to its own size.
    """
    air = [load / AIR - 1 for load in (specimen.back, specimen.front) if load < _BACKED]
    return np.array([*((specimen.coats[k].q - specimen.coats[k].told_q) / 1e3 for k in coats), *air], np.float64)


def _descend(residual: Callable[[Reals], Reals], x: Reals) -> tuple[Reals, float]:
    r = residual(x)
    damping = 1e-8
    for _ in range(_ROUNDS):
        J = np.stack([(residual(x + _STEP * e) - r) / _STEP for e in np.eye(x.size)], axis=1)
        before = float(r @ r)
        for _ in range(6):
            scale = np.linalg.norm(J, axis=0) + 1e-12
            A = np.vstack([J / scale, np.sqrt(damping) * np.eye(x.size)])
            step = np.linalg.lstsq(A, np.concatenate([-r, np.zeros(x.size)]), rcond=None)[0] / scale
            trial = residual(x + np.clip(step, -0.3, 0.3))
            if float(trial @ trial) < before:
                x, r, damping = x + np.clip(step, -0.3, 0.3), trial, damping / 10
                break
            damping = max(damping, 1e-6) * 30
        if before - float(r @ r) < 1e-3 * before + 1e-6:
            break
    return x, float(r @ r)
