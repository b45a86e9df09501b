"""How detectable an effect is: the chi2 that remains after all free constants have been fitted without it.

The constants that a fitter frees are fitted here to noise-free recordings of this world, by Gauss-Newton steps with
derivatives from finite differences. The remaining chi2 is the gain that naming the effect can bring.
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
    """The best fit of the free constants without an effect."""

    gain: float
    """Remaining chi2."""
    device: DeviceUnderTest
    """The device with the biased constants."""


def fit_without(scenario: Scenario, index: int, sweeps: Sequence[SweepSpec]) -> AbsorbedFit:
    """Return the best fit without effect number `index`; the sizes of all other effects are free."""
    without = scenario.without(index)
    target = [np.log(record(scenario.device, scenario.hidden(sweep.step), sweep)) for sweep in sweeps]
    others = [k for k, effect in enumerate(scenario.effects) if k != index and effect.min_scale < effect.max_scale]
    layers = [k for k, layer in enumerate(scenario.device.layers) if layer.name not in scenario.omitted]
    size = 8 + sum(1 if scenario.device.layers[k].glue else 3 for k in layers) + len(others)

    def world(x: Reals) -> Scenario:
        device = changed(scenario.device, x[: size - len(others)], layers)
        effects: list[InjectedEffect] = list(without.effects)
        for k, change in zip(others, x[size - len(others) :], strict=True):
            effects[k] = replace(effects[k], scale=effects[k].scale * (1 + change))
        return Scenario(device, tuple(effects))

    def residual(x: Reals) -> Reals:
        here = world(x)
        rows = [
            _row(record(here.device, here.hidden(sweep.step), sweep), wanted, sweep)
            for sweep, wanted in zip(sweeps, target, strict=True)
        ]
        return np.concatenate([*rows, _priors(here.device, layers)])

    x, chi2 = _descend(residual, np.zeros(size))
    return AbsorbedFit(chi2, world(x).device)


def scaled_to_gain(
    scenario: Scenario, index: int, sweeps: Sequence[SweepSpec], gain: float
) -> tuple[Scenario, AbsorbedFit]:
    """Return the scenario with effect `index` scaled to be detectable with `gain`, within physical limits."""
    best, fit, power = scenario, fit_without(scenario, index, sweeps), 2.0
    for _ in range(5):
        effect = best.effects[index]
        if effect.min_scale >= effect.max_scale or 0.7 < fit.gain / gain < 1.4:
            break
        factor = float(np.clip((gain / max(fit.gain, 1e-6)) ** (1 / power), 0.02, 50.0))
        scaled = effect.at(effect.scale * factor)
        if scaled.scale == effect.scale:
            break
        best = replace(best, effects=tuple(scaled if k == index else other for k, other in enumerate(best.effects)))
        before, fit = fit, fit_without(best, index, sweeps)
        # most effects leave a residual proportional to their size, some (a spread of thickness) to its square
        exponent = np.log(max(fit.gain, 1e-9) / max(before.gain, 1e-9)) / np.log(scaled.scale / effect.scale)
        power = float(np.clip(exponent, 1.0, 5.0))
    return best, fit


def changed(device: DeviceUnderTest, x: Reals, layers: Sequence[int]) -> DeviceUnderTest:
    """Return the device with relative changes of the constants of its disk, of the air and of the free layers."""
    disk = replace(
        device.disk,
        c33D=device.disk.c33D * (1 + complex(x[0], x[1])),
        h33=device.disk.h33 * (1 + complex(x[2], x[3])),
        eps33S=device.disk.eps33S * (1 + complex(x[4], x[5])),
    )
    air = [AIR * max(1 + float(change), 0.0) for change in x[6:8]]
    all_layers, at = list(device.layers), 8
    for k in layers:
        layer = all_layers[k]
        if layer.glue:
            all_layers[k] = replace(layer, thickness=layer.thickness * float(np.exp(np.clip(x[at], -3, 3))))
            at += 1
        else:
            all_layers[k] = _changed_layer(layer, x[at : at + 3])
            at += 3
    back = air[0] if device.back == AIR else device.back
    return replace(device, disk=disk, layers=tuple(all_layers), back=back, front=air[1])


def _changed_layer(layer: BondedLayer, x: Reals) -> BondedLayer:
    z, c, q = layer.z * (1 + float(x[0])), layer.c * (1 + float(x[1])), layer.q * float(np.exp(np.clip(x[2], -3, 3)))
    return replace(layer, z=z, c=c, q=q)


def _row(z: Complexes, wanted: Complexes, sweep: SweepSpec) -> Reals:
    difference = np.log(z) - wanted
    wrapped = difference.real + 1j * ((difference.imag + np.pi) % (2 * np.pi) - np.pi)
    sigma = sweep.noise + 5e-6 / np.abs(z)
    return np.concatenate([wrapped.real / sigma, wrapped.imag / sigma])


def _priors(device: DeviceUnderTest, layers: Sequence[int]) -> Reals:
    """Return the deviations of layers and air from what is known, in units of its uncertainty.

    The load on a face in a jig can be anything from zero upwards: the uncertainty of air is as large as its value.
    """
    air = [load / AIR - 1 for load in (device.back, device.front) if load < _BACKED]
    return np.array([*((device.layers[k].q - device.layers[k].stated_q) / 1e3 for k in layers), *air], np.float64)


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
