"""The virtual bench: gluing, jig and compensation, noise, and effects during a sweep."""

import socket

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import j0, j1

from pzctl.models.effects import catalogue
from pzctl.models.stack import AIR, Elastic, Piezo, Stack
from pzctl.sim.bench.bench import Bench
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.bench.bench_errors import BenchError
from pzctl.sim.bench.hidden_effects import KINDS, parse
from pzctl.sim.bench.jig import JIGS, Jig
from pzctl.sim.bench.sample import STEPS, sample
from pzctl.sim.bench.sweep_effects import Effects
from pzctl.sim.instrument.accuracy import noise_sigma, terms
from pzctl.sim.instrument.axis import plain_axis
from pzctl.sim.instrument.correction import Correction
from pzctl.sim.instrument.state import State
from pzctl.sim.instrument.sweep_timing import point_seconds


def axis_of(start=3e6, stop=5e6, points=201, level=0.5, bandwidth=5, average=1):
    return plain_axis(
        parameter="FREQ", kind="LIN", start=start, stop=stop, points=points, fixed_frequency=1e3, level=level,
        bandwidth=bandwidth, point_average=average,
    )  # fmt: skip


def measured(bench, axis, reverse=False):
    return bench.measure(axis, point_seconds(axis), reverse)


def quiet(**effects):
    return Bench(noise=False, jig=JIGS["ideal"], effects=Effects(**effects))


# the story ---------------------------------------------------------------------------------------------------------


def test_a_measurement_equals_the_truth_of_the_bench(lab_with):
    lab = lab_with(noise=False, jig="ideal", seed=5)
    wire = lab.wire()
    for step in STEPS:
        assert lab.bench("step", name=step)["step"] == step
        wire.say("*RST;STAR 1 MHZ;STOP 9 MHZ;SING;*OPC?")
        wire.line()
        told = lab.bench("truth")
        k = {name: complex(c["re"], c["im"]) for name, c in told["constants"].items()}
        layers = [
            Piezo("disk", thickness=k["disk.thickness"].real, density=k["disk.density"].real, c33D=k["disk.c33D"],
                  h33=k["disk.h33"], eps33S=k["disk.eps33S"])
        ]  # fmt: skip
        layers += [
            Elastic(n, **{p: k[f"{n}.{p}"].real for p in ("thickness", "z", "c", "q")}) for n in told["layers"][1:]
        ]
        stack = Stack(layers=tuple(layers), back=AIR, front=AIR, area=told["area_m2"])
        z = wire.impedance()
        np.testing.assert_allclose(z, stack.impedance(wire.block("FORM3;OUTPSWPRM?", ">f8")), rtol=5e-6)


def test_glue_does_not_come_off_but_a_new_sample_does(lab):
    assert lab.bench("next")["layers"] == ["disk", "glue1", "ml1"]
    assert lab.bench("next")["step"] == "ml2"
    for command in ({"command": "next"}, {"command": "step", "name": "ml1"}, {"command": "step", "name": "ml3"}):
        with pytest.raises(BenchError, match="bench: "):
            bench_command("127.0.0.1", lab.sim.bench_port, **command)
    status = lab.bench("new-sample", seed=7)
    assert (status["step"], status["seed"]) == ("disk", 7)


def test_a_sample_is_the_same_every_time_and_differs_from_the_next():
    assert sample(3) == sample(3)
    assert sample(3).layers[0].c33D != sample(4).layers[0].c33D


@given(st.integers(0, 10_000))
def test_every_sample_is_passive_and_near_the_thesis(seed):
    disk = sample(seed).layers[0]
    loss = disk.c33D.imag * (1 / disk.eps33S).imag - disk.h33.imag**2
    assert disk.c33D.imag > 0
    assert loss > 0
    assert abs(disk.thickness / 0.512e-3 - 1) < 0.01


def test_the_same_run_gives_the_same_numbers_whatever_swept_before(lab_with):
    def run():
        wire = lab_with(seed=3).wire()
        wire.say("PRES;OUTPDATA?")
        wire.line()
        wire.say("*RST;STAR 1 MHZ;STOP 6 MHZ;SING;*OPC?")
        wire.line()
        return wire.impedance()

    np.testing.assert_array_equal(run(), run())


@pytest.mark.parametrize(
    "line",
    [
        b"hello\n",
        b"[1]\n",
        b'{"command": 7}\n',
        b'{"command":"step"}\n',
        b"\xff\n",
        b'{"command":"step","name":"disk","name":"ml1"}\n',
        b'{"command":"power-cycle","seconds":1e300}\n',
        b'{"command":"power-cycle","seconds":-1}\n',
    ],
)
def test_a_line_that_is_no_command_gets_a_sentence(lab, line):
    with socket.create_connection(("127.0.0.1", lab.sim.bench_port), 10) as link, link.makefile("rb") as stream:
        link.sendall(line)
        answer = stream.readline()
        assert answer.startswith(b'{"ok": false, "error": "bench: ')
        link.sendall(b'{"command": "status"}\n')
        assert stream.readline().startswith(b'{"ok": true')


def test_the_helper_says_when_nobody_answers():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(BenchError, match="nobody answers"):
        bench_command("127.0.0.1", port, command="status")


def test_the_disk_has_radial_modes_on_request(lab):
    wire = lab.wire()
    wire.say("*RST;STAR 80E3;STOP 1.5E6;POIN 801;SING;*OPC?")
    wire.line()
    smooth = wire.impedance()
    assert np.all(np.diff(abs(smooth)) < 0.01 * abs(smooth[1:])), "nothing but a capacitance"
    lab.bench("effects", radial=True)
    told = lab.bench("truth")["constants"]
    s11, s12, density = (told[f"disk.{k}"]["re"] for k in ("s11E", "s12E", "density"))
    sigma = -s12 / s11
    eta = brentq(lambda x: x * j0(x) / j1(x) - 1 + sigma, 1.5, 2.5)
    first = eta / (2 * np.pi * 8e-3) * np.sqrt(1 / (s11 * (1 - sigma**2) * density))
    wire.say("SING;*OPC?")
    wire.line()
    f = wire.block("FORM3;OUTPSWPRM?", ">f8")
    assert f[np.argmax((1 / wire.impedance()).real / f)] == pytest.approx(first, rel=0.01)


# jig and compensation ----------------------------------------------------------------------------------------------


jigs = st.builds(
    Jig,
    resistance=st.floats(0, 1),
    inductance=st.floats(0, 3e-7),
    capacitance=st.floats(0, 1e-11),
    conductance=st.floats(0, 1e-6),
)


@given(jigs, st.complex_numbers(min_magnitude=0.5, max_magnitude=1e4).filter(lambda z: z.real > 0))
def test_open_and_short_remove_any_jig(jig, z):
    f = np.linspace(40.0, 15e6, 7)
    fixture = Correction()
    fixture.store("A", f, jig.through(f, np.zeros(7, complex)))
    fixture.store("B", f, jig.short(f))
    np.testing.assert_allclose(fixture.apply(f, jig.through(f, np.full(7, 1 / z)), State()), z, rtol=1e-6)


def test_open_short_load_over_the_wire(lab_with):
    lab = lab_with(noise=False, jig="clips", time_scale=0)
    ideal = lab_with(noise=False, jig="ideal")
    setup = "*RST;STAR 1 MHZ;STOP 6 MHZ;CALP USER;SING;*OPC?"
    wire, reference = lab.wire(), ideal.wire()
    for client in (wire, reference):
        client.say(setup)
        client.line()
    truth = reference.impedance()
    assert np.max(abs(wire.impedance() / truth - 1)) > 0.5, "150 nH matter at 4 MHz"
    for command, content in (("COMA", "open"), ("COMB", "short"), ("COMC", "load")):
        lab.bench("connect", what=content)
        wire.say(command + ";*OPC?")
        assert wire.line() == "1\n"
        assert int(wire.ask("ESB?")) & 256
    lab.bench("connect", what="device")
    assert [wire.ask(f"COMST{s}?") for s in "ABC"] == ["1", "1", "1"]
    wire.say("SING;*OPC?")
    wire.line()
    np.testing.assert_allclose(wire.impedance(), truth, rtol=2e-5)
    short = wire.block("FORM3;OUTPCOMC2?", ">f8")
    assert short[0] == pytest.approx(60e-3)
    wire.say("FORM4;COMSTA OFF;COMSTB OFF;COMSTC OFF;SING;*OPC?")
    wire.line()
    assert np.max(abs(wire.impedance() / truth - 1)) > 0.5


def test_nonsensical_standards_give_huge_numbers(lab):
    wire = lab.wire()
    wire.say("*RST;STAR 1 MHZ;STOP 6 MHZ;CALP USER")
    lab.bench("jig", name="ideal")
    lab.bench("connect", what="short")
    wire.say("COMB;COMA;COMC;SING;*OPC?")
    wire.line()
    assert np.all(np.isfinite(wire.impedance()))
    assert wire.ask("*IDN?").startswith("HEWLETT")


def test_corrections_at_fixed_points_are_interpolated(lab_with):
    lab = lab_with(noise=False, jig="coax")
    wire = lab.wire()
    wire.say("*RST;STAR 1 MHZ;STOP 6 MHZ")
    lab.bench("connect", what="short")
    wire.say("COMB;*OPC?")
    wire.line()
    wire.say("SING;*OPC?")
    wire.line()
    assert np.max(abs(wire.impedance())) < 1e-6


# noise and accuracy ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("bandwidth", "average", "sigma"), [(1, 1, 2e-4), (5, 1, 4e-5), (5, 16, 1e-5)])
def test_noise_equals_that_of_real_exports(bandwidth, average, sigma):
    axis = axis_of(10e3, 100e3, 801, bandwidth=bandwidth, average=average)
    bench = Bench(jig=JIGS["ideal"])
    clean = quiet()
    error = measured(bench, axis) / measured(clean, axis) - 1
    assert np.sqrt(np.mean(abs(error) ** 2)) == pytest.approx(sigma, rel=0.15)


def test_noise_grows_at_the_extremes_and_with_a_weak_signal():
    f, five, half = np.full(3, 1e6), np.full(3, 5.0), np.full(3, 0.5)
    sigma = noise_sigma(np.array([0.1, 100, 1e6], complex), f, five, half, np.ones(3))
    assert sigma[0] > 5 * sigma[1] < sigma[2]
    weak = noise_sigma(np.full(3, 100 + 0j), f, five, np.full(3, 5e-3), np.ones(3))
    assert weak[0] > 5 * sigma[1]


@pytest.mark.parametrize(
    ("f", "bandwidth", "z", "percent"),
    [
        (1e6, 5, 10, 0.10), (1e6, 5, 1e5, 0.125), (1e6, 1, 10, 0.63), (1e6, 1, 1e5, 0.78), (3e6, 5, 10, 0.33),
        (3e6, 1, 1e4, 1.20), (10e6, 5, 1e4, 1.05), (10e6, 5, 1e5, 1.50),
    ],
)  # fmt: skip
def test_accuracy_equals_that_of_the_manual(f, bandwidth, z, percent):
    t = terms(np.array([f]), np.array([float(bandwidth)]), np.array([0.5]))
    assert t.percent(np.array([complex(z)]))[0] == pytest.approx(percent, abs=0.011)


def test_the_systematic_error_is_the_same_each_time_and_within_the_accuracy():
    axis = axis_of(1e6, 6e6)
    off = Bench(noise=False, off=True, jig=JIGS["ideal"])
    first, again, truth = measured(off, axis), measured(off, axis), measured(quiet(), axis)
    np.testing.assert_array_equal(first, again)
    allowed = terms(axis.frequency, axis.bandwidth, axis.level).percent(truth) / 100
    error = abs(first / truth - 1)
    assert np.all(error <= allowed)
    assert np.all(error > allowed / 100)


# effects -----------------------------------------------------------------------------------------------------------


def peak(axis, z):
    """Frequency of the antiresonance, from a parabola through the highest points."""
    k = int(np.argmax(abs(z)))
    a, b, _ = np.polyfit(axis.frequency[k - 2 : k + 3] - axis.frequency[k], abs(z[k - 2 : k + 3]), 2)
    return axis.frequency[k] - b / (2 * a)


def test_drift_separates_sweeps_up_and_down():
    axis = axis_of(4.2e6, 4.5e6)
    still, drifting = peak(axis, measured(quiet(), axis)), quiet(drift_K_per_s=0.05)
    up, down = peak(axis, measured(drifting, axis)), peak(axis, measured(drifting, axis, reverse=True))
    assert down < up < still, "the stiffness falls as it warms"


def test_lag_shifts_with_the_direction():
    axis = axis_of(4.2e6, 4.5e6)
    still = peak(axis, measured(quiet(), axis))
    rate = np.gradient(axis.frequency)[0] / point_seconds(axis)[0]
    lag = 500 / rate
    up, down = (peak(axis, measured(quiet(lag_s=lag), axis, reverse=r)) for r in (False, True))
    assert up - still == pytest.approx(500, abs=60)
    assert down - still == pytest.approx(-500, abs=60)


def test_the_level_bends_the_resonance_in_proportion():
    def antiresonance(level):
        axis = axis_of(4.3e6, 4.4e6, level=level)
        return peak(axis, measured(quiet(strain_softening=3e3), axis))

    linear = peak(axis_of(4.3e6, 4.4e6), measured(quiet(), axis_of(4.3e6, 4.4e6)))
    weak, half, full = (linear - antiresonance(level) for level in (0.005, 0.5, 1.0))
    assert full / half == pytest.approx(2, rel=0.1)
    assert 0 < weak < full / 100


def test_effects_are_set_on_the_bench(lab):
    assert lab.bench("effects", drift_K_per_s=0.1, noise=False)["effects"]["drift_K_per_s"] == 0.1
    for wrong in ({"gravity": 1}, {"lag_s": "much"}):
        with pytest.raises(BenchError, match="bench: "):
            lab.bench("effects", **wrong)


SIZES = {
    "lead-inductance": 2e-8,
    "series-resistance": 0.3,
    "stray-capacitance": 5e-12,
    "leakage": 1e-5,
    "drive-nonlinearity": 1e3,
    "sweep-lag": 5e-3,
    "temperature-drift": 0.05,
}


def test_every_hidden_effect_is_in_the_catalogue():
    assert set(KINDS) == set(SIZES) <= {effect.name for effect in catalogue()}


@pytest.mark.parametrize("name", SIZES)
def test_hidden_effects_change_the_sweep_and_are_in_the_truth(lab_with, name):
    def swept(**options):
        lab = lab_with(noise=False, **options)
        wire = lab.wire()
        wire.say("*RST;STAR 3 MHZ;STOP 5 MHZ;SING;*OPC?")
        wire.line()
        return wire.impedance(), lab

    (plain, lab), (changed, told) = swept(), swept(hidden={name: SIZES[name]})
    assert np.max(abs(changed / plain - 1)) > 1e-4
    assert told.bench("truth")["hidden"][name] == SIZES[name]
    assert lab.bench("hidden", **{name: SIZES[name]})["hidden"][name] == SIZES[name]
    assert lab.bench("hidden", **{name: 0})["hidden"][name] == 0


@pytest.mark.parametrize("wrong", [{"gravity": 1}, {"leakage": -1}, {"sweep-lag": "much"}, {"leakage": float("nan")}])
def test_what_cannot_be_hidden_gets_a_sentence(lab, wrong):
    with pytest.raises(BenchError, match=f"bench: .*{next(iter(wrong))}"):
        lab.bench("hidden", **wrong)
    with pytest.raises(BenchError, match="NAME=VALUE"):
        parse(["lead-inductance:2e-8"])
