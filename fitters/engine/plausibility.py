"""Plausibility: reject recordings that determine nothing, and results that no ceramic could give."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ...models.base.arrays import Reals
from ...models.build import Build, LayerSpec
from ...models.sweep import Sweep
from ..interface import Constant, FitError, is_undetermined
from .noise import noise_of
from .physical_range import OTHER, beyond_solids, too_thick
from .start import largest_peaks

_FAR, _OFF = 30.0, 6.0
# Factors between |Z| and that of the build's clamped capacitance: beyond the first the device is no disk at all, beyond
# the second its dimensions are wrong. The free capacitance is up to 2.3 times the clamped one.
_NEAR = 2.5
# The same factor within which the capacitance of the other connection of several piezo layers matches.
_BELOW = 0.4
# In units of the thickness resonance: a sweep that ends below this cannot contain it, however wrong the data sheet is.
_MOST = 0.5
_NOISE = 0.01
# Part of |Z| below which the sign of a resistance is not significant.
_ABSENT, _NO_WAVE, _RAN_AWAY = 0.03, 1.0, 0.02
# Part of its impedance below which a layer is not there; a quality factor that only a fit without a minimum ends at;
# RMS log error that is no missing detail but a wrong device.
_NEED, _WANT = 0.25, 3.0
# Points per linewidth: below the first a resonance may lie between two points, below the second the loss depends on the
# model's shape of the flanks.
_SCATTER = {"eps33S": (0.7, 1.4), "c33D": (0.75, 1.3), "s11E": (0.7, 1.4), "eps33T": (0.6, 1.6)}
# Ratio of fitted value to data sheet; the batches of no manufacturer scatter more.
_ANOTHER = {"eps33S": 1.8, "c33D": 1.49, "s11E": 1.49}
# Ratio beyond which neither scatter nor damage explains the deviation. Permittivities differ by as much between soft
# ceramics, so a wrong material name need not mean wrong sizes; eps33T is only reported, since s11E shows the diameter.

_NUMBER = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
"""The id of a recording that a daemon made."""


def refuse_degenerate(build: Build, sweeps: Mapping[str, Sequence[Sweep]]) -> None:
    """Raise FitError for a short or open circuit, an inverted sign, another size, or a missing thickness resonance."""
    refuse_another_device(build, sweeps)
    for step, of_step in sweeps.items():
        piezos = _piezos_of(build, step)
        values = piezos[0].values
        expected = 1 / sum(1 / _antiresonance(layer) for layer in piezos)
        if not any(map(_resonates, of_step)):
            ends = [edge for sweep in of_step for edge in (sweep.frequency[0], sweep.frequency[-1])]
            refuse_lost(of_step, expected, values["c33D"].im / values["c33D"].re)
            raise FitError(
                f"step {step!r} shows no resonance with an antiresonance above it between {min(ends) / 1e6:.4g} and "
                f"{max(ends) / 1e6:.4g} MHz; that of {_named_alone(piezos)} is expected near {expected / 1e6:.3g} MHz"
            )
        _refuse_below(build, step, of_step, expected)


def _refuse_below(build: Build, step: str, sweeps: Sequence[Sweep], expected: float) -> None:
    """Reject a bare disk swept only at its radial modes, far below the thickness mode `expected`, Hz."""
    highest = max(float(sweep.frequency[-1]) for sweep in sweeps)
    if len(build.step(step).layers) == 1 and highest < _BELOW * expected:
        raise FitError(
            f"step {step!r} ends at {highest / 1e6:.4g} MHz, far below the thickness resonance expected near "
            f"{expected / 1e6:.3g} MHz: only radial modes resonate there; use the fitter `radial`"
        )


def refuse_another_device(build: Build, sweeps: Mapping[str, Sequence[Sweep]]) -> None:
    """Raise FitError for a short or open circuit, an inverted sign, or another size."""
    for step, of_step in sweeps.items():
        capacitance = _capacitance(build, step, build.connection)
        rewired = _capacitance(build, step, "parallel" if build.connection == "series" else "series")
        for sweep in of_step:
            _refuse_sign(_named(step, sweep), sweep)
            _refuse_size(_named(step, sweep), sweep, capacitance, rewired)


def _piezos_of(build: Build, step: str) -> tuple[LayerSpec, ...]:
    return tuple(layer for layer in build.piezos if layer.name in build.step(step).layers)


def _named_alone(piezos: Sequence[LayerSpec]) -> str:
    return "the bare piezo layer" if len(piezos) == 1 else f"the {len(piezos)} piezo layers without others"


def _antiresonance(layer: LayerSpec) -> float:
    """Return the first antiresonance of a bare piezo layer by the build, Hz."""
    values = layer.values
    return float(np.sqrt(values["c33D"].re / values["density"].re)) / (2 * values["thickness"].re)


def _capacitance(build: Build, step: str, connection: str) -> float:
    """Return the clamped capacitance of a step by the build, F, with its piezo layers in series or in parallel."""
    values = [layer.values for layer in _piezos_of(build, step)]
    each = [v["eps33S"].re * build.area.re / v["thickness"].re for v in values]
    return sum(each) if connection == "parallel" else 1 / sum(1 / capacitance for capacitance in each)


def _named(step: str, sweep: Sweep) -> str:
    """Return what a sentence calls a recording: its file; or its step, and the number that a daemon gave it."""
    if not sweep.name:
        return f"the recording of step {step!r}"
    return f"recording {sweep.name} of step {step!r}" if _NUMBER.fullmatch(sweep.name) else sweep.name


def _refuse_sign(name: str, sweep: Sweep) -> None:
    size = np.abs(sweep.impedance)
    negative = float(np.mean(sweep.impedance.real < -_NOISE * size))
    inductive = float(np.mean(sweep.impedance.imag > _NOISE * size))
    if negative > _MOST and inductive > _MOST:
        raise FitError(f"{name} is inverted: resistance is negative at {negative:.0%} of its points; change its sign")
    if negative > _MOST:
        raise FitError(f"{name} has a negative resistance at {negative:.0%} of its points; no passive device has that")
    if inductive > 0.9:
        falls = float(np.polyfit(np.log(sweep.frequency), np.log(size), 1)[0]) < 0
        why = (
            "while |Z| falls like a capacitor's: the sign of its reactance is that of exp(-jwt), conjugate it"
            if falls
            else "and |Z| rises: this is a wire, not a piezo disk; is it shorted?"
        )
        raise FitError(f"{name} is inductive at {inductive:.0%} of its points, {why}")


def _refuse_size(name: str, sweep: Sweep, capacitance: float, rewired: float) -> None:
    """Reject a recording whose |Z| does not match the build's capacitance (F), whatever its resonances.

    `rewired` is the capacitance with the other connection of the piezo layers.
    """
    expected: Reals = 1 / (2 * np.pi * sweep.frequency * capacitance)
    ratio = float(np.median(np.abs(sweep.impedance) / expected))
    level, wanted = float(np.median(np.abs(sweep.impedance))), float(np.median(expected))
    found = f"{name}: the median |Z| is {level:.3g} ohm, but the capacitance of this build gives {wanted:.3g} ohm"
    if not 1 / _OFF < ratio < _OFF and 1 / _NEAR < ratio * rewired / capacitance < _NEAR:
        says = f"with the piezo layers connected the other way it would be {wanted * capacitance / rewired:.3g} ohm"
        raise FitError(f"{found}; {says}: correct [electrical] connection in the build file")
    if ratio < 1 / _FAR:
        raise FitError(
            f"{found}; this is a short circuit, another device, another unit, or another size than the build's"
        )
    if ratio > _FAR:
        raise FitError(
            f"{found}; this is an open circuit, another device, another unit, or another size than the build's"
        )
    if not 1 / _OFF < ratio < _OFF:
        raise FitError(
            f"{found}; a permittivity is never off by a factor of {max(ratio, 1 / ratio):.1f}: diameter or thickness "
            "of the build file are not those of this device"
        )


def _resonates(sweep: Sweep) -> bool:
    w = 2 * np.pi * sweep.frequency
    _, (noise,) = noise_of([sweep])
    series = largest_peaks(sweep.admittance.real / w, noise * np.abs(sweep.admittance) / w)
    return bool(series or largest_peaks(sweep.impedance.real * w, noise * np.abs(sweep.impedance) * w))


def doubts(
    build: Build,
    sweeps: Mapping[str, Sequence[Sweep]],
    constants: Mapping[str, Constant],
    derived: Mapping[str, Constant],
    rms_log_error: float,
) -> tuple[str, ...]:
    """Return warnings about the result of a stack; `rms_log_error` tells a fit that ran away from another material.

    Raises FitError if the recordings have too few points to resolve a resonance of that width, or if the constants are
    those of another disk than the build's.
    """
    says: list[str] = []
    for piezo in (layer for layer in build.piezos if f"{layer.name}.c33D" in constants):
        alone = (step for step in sweeps if build.step(step).layers == (piezo.name,))
        bare = [sweep for step in alone for sweep in sweeps[step]]
        c33D, fp = constants[f"{piezo.name}.c33D"], derived[f"{piezo.name}.fp"].re
        refuse_lost(bare, fp, c33D.im / c33D.re)
        says += few_points(bare, fp, c33D.im / c33D.re)
        if piezo.values["c33D"].same_as is None:
            says += strange(build, piezo, constants)
    glued = [layer for layer in build.layers if layer.kind == "elastic" and f"{layer.name}.z" in constants]
    ran_away = rms_log_error > _RAN_AWAY
    for layer in glued:
        elsewhere = _elsewhere(layer, constants, ran_away=ran_away)
        says += [elsewhere] if elsewhere else beyond_solids(layer, constants)
        says += too_thick(build, layer, constants) if ran_away else ()
        if is_undetermined(f"{layer.name}.q", constants[f"{layer.name}.q"]):
            says.append(f"{layer.name}.q is not determined: the fit finds no losses in {layer.name!r}.")
    return tuple(says)


def _elsewhere(layer: LayerSpec, constants: Mapping[str, Constant], *, ran_away: bool) -> str | None:
    """Return a warning if the constants of a glued layer are far from the build's, or its damping is without limit."""
    z = constants[f"{layer.name}.z"]
    if z.free and is_absent(layer, z.re):
        return f"{z.re:.2g} Rayl is no layer: {layer.name!r} is not on the device that was measured as its step."
    found: list[str] = []
    for name in ("z", "c", "q", "thickness"):
        given, fitted = layer.values[name], constants[f"{layer.name}.{name}"]
        away = abs(fitted.re - given.re) / given.u if given.u > 0 else 0.0
        if name == "q" and given.u > 0 and fitted.re < _NO_WAVE:
            found.append(f"{layer.name}.q reached its lower limit, {fitted.re:.2g}")
        elif name != "q" and away > OTHER:
            of = f" of {layer.material}" if layer.material and given.source != "build.toml" else " of the build"
            found.append(f"{layer.name}.{name} is {fitted.re:.3g}, {away:.0f} u from the {given.re:.3g}{of}")
    if not found:
        return None
    which = "; ".join(found)
    if ran_away:
        return (
            f"The fit ran away: {which}. No layer like {layer.name!r} of the build describes this recording: check "
            "that this step is what was measured, and the layer's material and thickness. Do not use these constants."
        )
    return f"{which}: this layer has another material or thickness than the build file says."


def is_absent(layer: LayerSpec, z: float) -> bool:
    """Return whether a fitted impedance, Rayl, is so small that the elastic layer is not there."""
    return z < _ABSENT * layer.values["z"].re


def few_points(sweeps: Sequence[Sweep], at: float, loss: float) -> tuple[str, ...]:
    """Return a warning if a resonance at `at` Hz with this loss tangent has few points in its linewidth."""
    count = _points_in(sweeps, at, loss)
    if count < _WANT:
        few = f"Only {_counted(count, at, loss)}: the losses depend on the model's shape of the flanks."
        return (f"{few} {_WANT:.0f} or more are needed.",)
    return ()


def refuse_lost(sweeps: Sequence[Sweep], at: float, loss: float) -> None:
    """Raise FitError if a resonance at `at` Hz with this loss tangent may lie between two points of all sweeps."""
    count = _points_in(sweeps, at, loss)
    if count < _NEED:
        raise FitError(
            f"only {_counted(count, at, loss)}; the resonance is lost between them: sweep it every "
            f"{loss * at / 10 / 1e3:.2g} kHz"
        )


def _counted(count: float, at: float, loss: float) -> str:
    points = f"{count:.2g}"
    points += " point lies" if points == "1" else " points lie"
    return f"{points} in the linewidth of {loss * at / 1e3:.3g} kHz at {at / 1e6:.4g} MHz"


def _points_in(sweeps: Sequence[Sweep], at: float, loss: float) -> float:
    """Return the points per linewidth of the finest sweep that contains `at`; infinite if none does."""
    spacings = [_spacing(sweep, at) for sweep in sweeps if sweep.frequency[0] < at < sweep.frequency[-1]]
    return loss * at / min(spacings) if spacings and loss > 0 else np.inf


def _spacing(sweep: Sweep, fp: float) -> float:
    """Return the distance of the points near `fp`, Hz."""
    k = int(np.searchsorted(sweep.frequency, fp))
    return float(np.min(np.diff(sweep.frequency)[max(0, k - 2) : k + 2]))


def strange(build: Build, piezo: LayerSpec, constants: Mapping[str, Constant]) -> tuple[str, ...]:
    """Return warnings about constants beyond a ceramic's scatter: c33D indicates the thickness, the others the area.

    Raises FitError if a constant is so far off that the build file must describe another disk, unless the build file
    gives the constant itself.
    """
    says: list[str] = []
    reported: set[str] = set()
    for name, (low, high) in _SCATTER.items():
        sheet, fitted = piezo.nominal.get(name), constants.get(f"{piezo.name}.{name}")
        what = "thickness" if name == "c33D" else "area"
        if sheet is None or fitted is None or not fitted.free or low < fitted.re / sheet.re < high or what in reported:
            continue
        reported.add(what)
        ratio = fitted.re / sheet.re
        outlier = f"{piezo.name}.{name} comes out at {ratio:.2f} times what the data sheet of {piezo.material} says"
        explained = f"{_explained(build, piezo, what, ratio)} would explain it"
        if what == "thickness":
            explained += ", if no other value of the build is wrong and the band holds no radial modes"
        far = max(ratio, 1 / ratio) > _ANOTHER.get(name, np.inf)
        if far and piezo.values[name].source != "build.toml":
            raise FitError(
                f"{outlier}, which no disk of it has: {explained}; correct the build file, or give {name} there with "
                "an uncertainty if this is another ceramic"
            )
        says.append(
            f"{outlier}, more than ceramics scatter: {explained}. Do not use these constants before that is settled."
        )
    return tuple(says)


def _explained(build: Build, piezo: LayerSpec, what: str, ratio: float) -> str:
    """Return the size that would bring a constant back to its data sheet."""
    if what == "thickness":
        return f"a thickness of {1e3 * piezo.values['thickness'].re / np.sqrt(ratio):.3g} mm"
    if build.diameter is None:
        return f"an area of {1e6 * build.area.re * ratio:.3g} mm2"
    size, hole = 1e3 * build.diameter.re, 0.0 if build.hole_diameter is None else 1e3 * build.hole_diameter.re
    other = np.sqrt(ratio * (size**2 - hole**2) + hole**2)
    return f"a diameter of {other:.3g} mm instead of {size:.3g} mm"
