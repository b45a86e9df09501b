"""The transducer on the bench: a stack whose true constants are defined only here, unless it is of a build.

The numbers are those of the thesis (Tjelde, NTNU 2012, tables 4.1 to 4.7): a Pz27 disk whose fitted constants
differ from the data sheet's, as real ones do, and two glued matching layers. Every seed gives another sample.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...models.base.model import Model
from ...models.constants.causal import continued
from ...models.constants.piezo_constants import Radial
from ...models.disk.round_disk import BothModes
from ...models.stack import AIR, CausalConstantQ, Elastic, Layer, Piezo, Stack
from .bench_errors import BenchError

EPS0 = 8.8541878128e-12
AREA = np.pi * 8e-3**2
"""Area of the disk of 16 mm diameter, m2."""

RADIAL_REFERENCE = 128e3
"""Hz, near the first radial resonance: where the radial constants are the stated ones."""

ALPHA, D33F = 0.72, 1.2e-10
"""c13E/c33E, and e33/c33E in C/N: thickness motion in a radial mode. Close to Pz27's."""

STEPS = ("disk", "ml1", "ml2")
"""The gluing steps in order: each adds a glue line and a matching layer."""

GLUE_Z, GLUE_C33, GLUE_Q = 2.8e6, 6.86e9, 13.0
"""The thesis's epoxy: Rayl, Pa, quality factor."""


@dataclass(frozen=True)
class BenchSample:
    """One transducer at all its gluing steps, identified by `seed`."""

    seed: int
    stacks: Mapping[str, Stack]
    """The device after each gluing step, in their order."""
    radial: Radial | None = None
    """The disk's radial constants, if it has radial modes; its eps33T follows from all constants."""
    beside: Mapping[str, Model] = field(default_factory=dict[str, Model])
    """What is measured after a step that has more than its stack, such as a lead."""

    @property
    def steps(self) -> tuple[str, ...]:
        """The gluing steps in order."""
        return tuple(self.stacks)

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers after the last step, back to front."""
        return self.stacks[self.steps[-1]].layers

    @property
    def piezos(self) -> tuple[str, ...]:
        """The names of the piezoelectric layers, back to front."""
        return tuple(layer.name for layer in self.layers if isinstance(layer, Piezo))

    def device(self, step: str, radial: bool) -> Model:
        """Return the device after a gluing step, with or without the disk's radial modes.

        With them, losses are causal between the modes: over the five octaves between them, the loss of a permittivity
        changes it by 2 %. `truth` has the constants at `RADIAL_REFERENCE` and at the thickness mode's antiresonance.
        Glued layers do not load the radial modes. Raises BenchError for an unknown step.
        """
        stack = self.stack(step)
        if not radial:
            return self.beside.get(step, stack)
        disk = self.layers[0]
        if self.radial is None or not isinstance(disk, Piezo):
            raise BenchError(f"bench: the sample at step {step!r} has no radial modes")
        law = CausalConstantQ(_antiresonance(disk))
        causal = replace(disk, c_law=law, h_law=law, eps_law=law)
        both = BothModes.of(replace(stack, layers=(causal, *stack.layers[1:])), disk.name, self.radial)
        laws = dict.fromkeys(("s11E", "s12E", "d31"), CausalConstantQ(RADIAL_REFERENCE))
        return replace(both, arm=replace(both.arm, alpha=ALPHA, d33f=D33F, laws=laws))

    def stack(self, step: str) -> Stack:
        """Return the layers after a gluing step and their loads. Raises BenchError for an unknown step."""
        if step not in self.stacks:
            raise BenchError(f"bench: no gluing step {step!r}; there are {', '.join(self.stacks)}")
        return self.stacks[step]

    def names(self, step: str) -> tuple[str, ...]:
        """Return the layers after a step, back to front. Raises BenchError."""
        return tuple(layer.name for layer in self.stack(step).layers)

    def truth(self) -> dict[str, dict[str, float | str]]:
        """Return every true constant by its name (`disk.c33D`): real and imaginary part and unit."""
        table: dict[str, dict[str, float | str]] = {}
        for layer in self.layers:
            if isinstance(layer, Piezo | Elastic):
                for key, value, unit in _constants(layer):
                    table[f"{layer.name}.{key}"] = {"re": value.real, "im": value.imag, "unit": unit}
        for key, unit in (("s11E", "1/Pa"), ("s12E", "1/Pa"), ("d31", "C/N"), ("eps33T", "F/m")):
            if self.radial is not None:
                value = complex(getattr(self.radial, key))
                table[f"disk.{key}"] = {"re": value.real, "im": value.imag, "unit": unit}
        return table


def _constants(layer: Piezo | Elastic) -> list[tuple[str, complex, str]]:
    if isinstance(layer, Piezo):
        return [
            ("thickness", complex(layer.thickness), "m"),
            ("density", complex(layer.density), "kg/m3"),
            ("c33D", complex(layer.c33D), "Pa"),
            ("h33", complex(layer.h33), "V/m"),
            ("eps33S", complex(layer.eps33S), "F/m"),
        ]
    return [
        ("thickness", complex(layer.thickness), "m"),
        ("z", complex(layer.z), "Rayl"),
        ("c", complex(layer.c), "m/s"),
        ("q", complex(layer.q), "1"),
        ("c33", complex(layer.c33), "Pa"),
    ]


def sample(seed: int) -> BenchSample:
    """Return the sample of this seed: the same one every time."""
    random = np.random.default_rng([seed, 4294])

    def about(value: float, relative: float) -> float:
        """Scatter a value, never by more than three standard deviations."""
        return value * (1 + relative * float(np.clip(random.standard_normal(), -3, 3)))

    disk = _disk(about)
    glue1 = _glue("glue1", about(11e-6, 0.08))
    ml1 = _matching("ml1", about(10.3e6, 0.04), about(2455.0, 0.05), about(0.139e-3, 0.007), about(24.0, 0.12))
    glue2 = _glue("glue2", about(6.4e-6, 0.08))
    ml2 = _matching("ml2", about(2.4e6, 0.04), about(2250.0, 0.03), about(0.147e-3, 0.007), about(22.0, 0.10))
    layers = (disk, glue1, ml1, glue2, ml2)
    stacks = {step: Stack(layers[: 1 + 2 * k], AIR, AIR, AREA) for k, step in enumerate(STEPS)}
    return BenchSample(seed, stacks, _radial(about, disk))


def _antiresonance(disk: Piezo) -> float:
    """Return the first antiresonance of the bare disk, Hz."""
    return float(np.sqrt(disk.c33D.real / disk.density) / (2 * disk.thickness))


def _radial(about: Callable[[float, float], float], disk: Piezo) -> Radial:
    """Return the disk's radial constants, centred on the thesis's."""
    s11E = about(16.96e-12, 0.02) * (1 - 1j / about(90.0, 0.1))
    s12E = -about(6.60e-12, 0.02) * (1 - 1j / about(95.0, 0.1))
    d31 = -about(170e-12, 0.03) * (1 - 1j / about(100.0, 0.1))
    law, at = CausalConstantQ(_antiresonance(disk)), np.array([RADIAL_REFERENCE])
    c, h, eps = (complex(continued(law, value, at)[0][0]) for value in (disk.c33D, disk.h33, disk.eps33S))
    clamped = eps / (1 - h**2 * eps / c)
    return Radial(s11E, s12E, d31, clamped + 2 * d31**2 / (s11E + s12E))


def _disk(about: Callable[[float, float], float]) -> Piezo:
    """Return the Pz27 disk: centred on the thesis's results, which are 5 % stiffer than the data sheet."""
    density = about(7700.0, 0.003)
    speed = about(4434.0, 0.0025)
    return Piezo(
        "disk",
        thickness=about(0.512e-3, 0.002),
        density=density,
        c33D=density * speed**2 * (1 + 1j / about(107.0, 0.12)),
        h33=about(19.86e8, 0.015) * (1 + 1j * about(0.0049, 0.1)),
        eps33S=about(860.0, 0.03) * EPS0 * (1 - 1j * about(0.01135, 0.08)),
    )


def _glue(name: str, thickness: float) -> Elastic:
    return Elastic(name, thickness=thickness, z=GLUE_Z, c=GLUE_C33 / GLUE_Z, q=GLUE_Q)


def _matching(name: str, z: float, c: float, thickness: float, q: float) -> Elastic:
    return Elastic(name, thickness=thickness, z=z, c=c, q=q)
