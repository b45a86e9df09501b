"""A bare round disk as in a build.toml, and noise."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from complex_ceramic import MATERIAL
from numpy.typing import NDArray

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.models.base.model import Model
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

DISK = """
name = "D"
diameter_mm = {{ value = {diameter}, u = {u_diameter} }}
[[layers]]
name = "disk"
kind = "piezo"
material = "{material}"
thickness_mm = {{ value = {thickness}, u = {u_thickness} }}
density_kg_m3 = {{ value = {density}, u = {u_density} }}
{more}
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
"""


@pytest.fixture
def disk_build() -> Callable[..., Build]:
    """Builds of one bare disk from the library's materials or the tests' own ceramic; sizes in mm and kg/m3."""

    def make(
        material: str,
        sizes: tuple[float, float, float],
        u: tuple[float, float, float] = (0.01, 0.001, 10.0),
        more: str = "",
    ) -> Build:
        (diameter, thickness, density), (u_diameter, u_thickness, u_density) = sizes, u
        names = ("diameter", "u_diameter", "thickness", "u_thickness", "density", "u_density")
        values = (diameter, u_diameter, thickness, u_thickness, density, u_density)
        own = material == MATERIAL.name
        sizes_and_u = dict(zip(names, values, strict=True))
        build = parse_build(DISK.format(material="PZT-5A" if own else material, more=more, **sizes_and_u))
        if not own:
            return build
        constants = {name: value for name, value in MATERIAL.values.items() if name != "density"}
        disk = replace(build.layers[0], material=material, values={**build.layers[0].values, **constants})
        return replace(build, layers=(disk,))

    return make


@pytest.fixture
def swept() -> Callable[..., Sweep]:
    """Sweeps of a model with relative noise."""

    def make(model: Model, frequency: NDArray[np.float64], noise: float = 1e-4, seed: int = 0) -> Sweep:
        rng = np.random.default_rng(seed)
        both = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
        return Sweep(frequency, model.impedance(frequency) * np.exp(noise * both), id="sweep")

    return make
