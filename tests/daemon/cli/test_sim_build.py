"""`pzctl sim --build`: a transducer of a build on the bench, with constants that scatter as the build says."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.cli.lab.sample_of_build import sample_of
from pzctl.daemon.files.builds.build_file import read_build
from pzctl.fitters.interface import FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.stack import Piezo
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.bench import Bench
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.bench.bench_errors import BenchError
from pzctl.sim.server import SimOptions, running

LANGEVIN = read_build(Path(__file__).resolve().parents[3] / "examples" / "langevin.toml")
draw = partial(sample_of, LANGEVIN)


def test_each_seed_is_another_transducer_of_the_build_and_equal_rings_stay_equal() -> None:
    first, again, other = draw(3), draw(3), draw(4)
    assert first == again
    assert first.truth() != other.truth()
    for seed in range(20):
        for step in draw(seed).stacks.values():
            ring1, ring2 = (layer for layer in step.layers if isinstance(layer, Piezo))
            assert (ring1.c33D, ring1.h33, ring1.eps33S) == (ring2.c33D, ring2.h33, ring2.eps33S)
            assert ring1.thickness != ring2.thickness
            known = LANGEVIN.layer("ring1").values["c33D"]
            assert abs(ring1.c33D.real - known.re) < 2.2 * known.u
            assert ring1.c33D.imag > 0 > ring1.eps33S.imag


def test_a_fit_finds_the_constants_that_the_bench_has() -> None:
    f = np.linspace(50e3, 1.2e6, 801)
    sample = draw(5)
    rng = np.random.default_rng(5)
    noise = 1e-4 * (rng.standard_normal(801) + 1j * rng.standard_normal(801))
    sweep = Sweep(f, sample.device("whole", radial=False).impedance(f) * np.exp(noise), id="whole")
    result = Mason().fit(FitTask(LANGEVIN, {"whole": (sweep,)}))
    truth = sample.truth()
    assert result.chi2_per_dof < 1.3
    for name in ("ring1.c33D", "ring1.eps33S", "ring2.h33", "tail.c", "head.z"):
        constant, true = result.constants[name], truth[name]["re"]
        assert isinstance(true, float)
        assert constant.u_re
        assert abs(constant.re - true) < 4 * constant.u_re, name


def test_the_bench_has_the_steps_of_the_build_and_refuses_what_its_sample_has_not() -> None:
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0), draw) as sim:
        status = bench_command("127.0.0.1", sim.bench_port, command="status")
        assert (status["steps"], status["layers"]) == (["whole"], ["tail", "ring1", "ring2", "head"])
        with pytest.raises(BenchError, match="no radial modes"):
            bench_command("127.0.0.1", sim.bench_port, command="effects", radial=True)
        with pytest.raises(BenchError, match="needs a single piezo layer; this sample has ring1, ring2"):
            bench_command("127.0.0.1", sim.bench_port, command="hidden", **{"drive-nonlinearity": 1e3})
    with pytest.raises(BenchError, match="no radial modes"):
        Bench(radial=True, draw=draw)
