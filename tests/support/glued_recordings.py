"""Recordings of a bare disk and of the same with glue and a matching layer, whose glue is another than the build's."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

F = np.linspace(2e6, 13e6, 301)
NOISE = 2e-4
_TOML = """
name = "glued"
diameter_mm = 14.0
load = { back = "air", front = "air" }

[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.53, u = 0.001 }
density_kg_m3 = 7700

[[layers]]
name = "glue"
kind = "elastic"
z_MRayl = 2.9
c_m_s = 2550
q = 30
thickness_mm = GLUE

[[layers]]
name = "ml"
kind = "elastic"
z_MRayl = { value = 5.0, u = 0.4 }
c_m_s = { value = 2500, u = 200 }
q = { value = 40, u = 25 }
thickness_mm = { value = 0.12, u = 0.001 }

[[steps]]
name = "bare"
layers = ["disk"]

[[steps]]
name = "glued"
layers = ["disk", "glue", "ml"]
"""


def glued_build(glue_mm: float, u_mm: float) -> Build:
    """Return a build of two gluing steps with glue of this thickness, which has library values."""
    return parse_build(_TOML.replace("GLUE", f"{{ value = {glue_mm}, u = {u_mm} }}"), "build.toml")


def recorded(build: Build, steps: Sequence[str] = ("bare", "glued"), **glue: float) -> dict[str, tuple[Sweep, ...]]:
    """Return sweeps of a device whose glue has these values."""
    rng = np.random.default_rng(0)
    sweeps: dict[str, tuple[Sweep, ...]] = {}
    for name in steps:
        stack = stack_of(build, build.step(name))
        layers = tuple(replace(one, **glue) if one.name == "glue" else one for one in stack.layers)
        noise = NOISE * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
        sweeps[name] = (Sweep(F, replace(stack, layers=layers).impedance(F) * np.exp(noise)),)
    return sweeps
