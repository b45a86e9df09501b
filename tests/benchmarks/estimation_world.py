"""Transducers with known truth for the estimation benchmarks: the bench's samples, and a lab's prior knowledge."""

from dataclasses import dataclass, replace

import numpy as np

from pzctl.fitters.interface import FitTask
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.stack import Elastic, HalfSpace, Piezo, Stack
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.sample import AREA, STEPS, sample

NOISE = 2e-4
"""Relative standard deviation of Re and Im of each point: 4294A, bandwidth 5."""
SEGMENTS = ((1e6, 6e6), (0.5e6, 15.5e6))
AIR = 413.0
KNOWN = {"thickness": 0.0, "density": 0.003, "z": 0.08, "c": 0.10, "q": 0.30}
"""Relative standard uncertainty of the prior knowledge; thicknesses are known to a micrometre."""
MICROMETER, GLUE = 1e-6, 0.3


@dataclass(frozen=True)
class World:
    """The true values of one transducer."""

    layers: tuple[Piezo | Elastic, ...]
    back: float
    front: float

    def stack(self, count: int) -> Stack:
        """The first `count` layers between the two loads."""
        return Stack(self.layers[:count], HalfSpace("back", self.back), HalfSpace("front", self.front), AREA)

    def parameters(self) -> dict[str, float]:
        """Every true model parameter by its name in a fit."""
        own = self.stack(len(self.layers)).parameters()
        return dict(own)

    def truth(self) -> dict[str, complex]:
        """Every true constant by its full name."""
        found: dict[str, complex] = {}
        for layer in self.layers:
            names = ("c33D", "h33", "eps33S") if isinstance(layer, Piezo) else ("z", "c", "q")
            found |= {f"{layer.name}.{name}": complex(getattr(layer, name)) for name in (*names, "thickness")}
        return found


def world(seed: int, rng: np.random.Generator) -> World:
    """A sample of the bench; the load of air on its faces is between zero and twice that of a free field."""
    back, front = (AIR * max(0.0, 1 + float(rng.standard_normal())) for _ in range(2))
    return World(sample(seed).layers, back, front)


def sweeps_of(one: World, steps: int, rng: np.random.Generator) -> dict[str, tuple[Sweep, ...]]:
    """The recordings of the first `steps` gluing steps, two segments each."""
    found: dict[str, tuple[Sweep, ...]] = {}
    for k, step in enumerate(STEPS[:steps]):
        stack, parts = one.stack(1 + 2 * k), []
        for low, high in SEGMENTS:
            f = np.linspace(low, high, 801)
            error = NOISE * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
            parts.append(Sweep(f, stack.impedance(f) * np.exp(error), id=step))
        found[step] = tuple(parts)
    return found


def build_of(one: World, rng: np.random.Generator) -> Build:
    """A lab's prior knowledge: data sheet of the disk, measured dimensions, tolerances of the layers, the glue held."""
    air = LoadSpec("air", Quantity(AIR))
    steps = tuple(Step(step, tuple(layer.name for layer in one.layers[: 1 + 2 * k])) for k, step in enumerate(STEPS))
    return Build("bench", Quantity(AREA), tuple(_spec(layer, rng) for layer in one.layers), air, air, steps)


def _spec(layer: Piezo | Elastic, rng: np.random.Generator) -> LayerSpec:
    def measured(name: str, u: float) -> Quantity:
        true = float(getattr(layer, name))
        return Quantity(max(0.2 * true, true + u * float(rng.standard_normal())), u=u, source="build.toml")

    glue = layer.name.startswith("glue")
    values = {"thickness": measured("thickness", GLUE * layer.thickness if glue else MICROMETER)}
    if isinstance(layer, Piezo):
        values |= {name: _sheet(complex(getattr(layer, name))) for name in ("c33D", "h33", "eps33S")}
        values["density"] = measured("density", KNOWN["density"] * layer.density)
        return LayerSpec(layer.name, "piezo", values)
    for name in ("z", "c", "q"):
        value = float(getattr(layer, name))
        values[name] = Quantity(value, source="build.toml") if glue else measured(name, KNOWN[name] * value)
    return LayerSpec(layer.name, "elastic", values)


def _sheet(value: complex) -> Quantity:
    """A data sheet's value, with a very large uncertainty."""
    return Quantity(value.real * 1.03, value.imag * 1.2, source="data sheet")


def task(seed: int, steps: int) -> tuple[World, FitTask]:
    """Transducer `seed` and its task for a fitter; the same every time."""
    rng = np.random.default_rng([seed, 77])
    one = world(seed, rng)
    return one, FitTask(build_of(one, rng), sweeps_of(one, steps, rng))


def far_start(one: World, given: FitTask, seed: int, reach: float = 0.3) -> FitTask:
    """The same recordings with every constant to be fitted off by up to `reach`, known to 30 %; dimensions exact."""
    rng = np.random.default_rng([seed, 30])
    assert given.build is not None

    def off(layer: LayerSpec, name: str, quantity: Quantity) -> Quantity:
        true = one.truth().get(f"{layer.name}.{name}", complex(quantity.re))
        if name == "density":
            true = complex(next(float(p.density) for p in one.layers if isinstance(p, Piezo)))
        if quantity.source == "data sheet":
            re, im = (1 + rng.uniform(-reach, reach, 2)).tolist()
            return replace(quantity, re=true.real * re, im=true.imag * im)
        moved = quantity.u > 0 and (name in ("z", "c", "q") or layer.name.startswith("glue"))
        if not moved:
            return Quantity(true.real, source="build.toml")
        return Quantity(true.real * (1 + rng.uniform(-reach, reach)), u=0.3 * true.real, source="build.toml")

    layers = tuple(
        replace(layer, values={name: off(layer, name, q) for name, q in layer.values.items()})
        for layer in given.build.layers
    )
    return replace(given, build=replace(given.build, layers=layers))
