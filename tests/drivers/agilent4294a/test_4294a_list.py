"""The list sweep: used only where the instrument is verified to have accepted every line."""

from dataclasses import replace

import numpy as np
import pytest

import pzctl.sim.instrument.state
from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.sweeps.list_sweep import batches, lines
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimOptions, running

JOINED = SweepPlan(
    (Segment(1e6, 2e6, 50), Segment(2.01e6, 4e6, 450), Segment(4.001e6, 6e6, 500)),
    bandwidth=4,
    oscillator_V=0.2,
    joined=True,
)


@pytest.fixture
def sim():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, noise=False)) as simulator:
        yield simulator


def measured(sim, plan=JOINED):
    analyzer = open_analyzer(sim.resource)
    try:
        return analyzer.measure(plan)[0]
    finally:
        analyzer.close()


def status(sim, **command):
    return bench_command("127.0.0.1", sim.bench_port, **command)


@pytest.mark.parametrize("more", [{}, {"bias_V": 2.0}, {"point_average": 2}, {"oscillator_A": 1e-3}])
def test_both_ways_give_the_same_recording_and_say_which_it_was(sim, more):
    plan = replace(JOINED, **more)
    listed = measured(sim, plan)
    after_list = status(sim, command="status")["exchanges"]
    status(sim, command="fault", kind="no-list")
    plain = measured(sim, plan)

    np.testing.assert_allclose(listed.frequency, plain.frequency, rtol=0, atol=1.01e-3)
    np.testing.assert_allclose(listed.impedance, plain.impedance, rtol=1e-6)
    assert listed.settings["sweep_type"] == "list"
    assert plain.settings["sweep_type"] == "segment by segment"
    assert "EDITLIST" in plain.settings["no_list_sweep"]
    assert "-113" in plain.settings["no_list_sweep"]
    differs = {"sweep_type", "no_list_sweep", "segments", "started", "ended", "sweep_seconds"}
    assert {k: v for k, v in listed.settings.items() if k not in differs} == {
        k: v for k, v in plain.settings.items() if k not in differs
    }
    assert after_list < status(sim, command="status")["exchanges"] - after_list


@pytest.mark.parametrize(
    "change",
    [
        {"segments": (Segment(1e6, 2e6, 11), Segment(3e6, 4e6, 11, "log"))},
        {"segments": (Segment(1e6, 2e6, 11), Segment(3e6, 4e6, 900))},
    ],
)
def test_plans_that_do_not_fit_a_table_are_swept_by_segment(sim, change):
    sweep = measured(sim, SweepPlan(**{"segments": JOINED.segments[:2], "joined": True, **change}))
    assert sweep.settings["sweep_type"] == "segment by segment"
    assert sweep.settings["no_list_sweep"]


def test_a_table_in_use_is_not_changed(sim):
    wire = open_analyzer(sim.resource)
    ask = wire._link.ask
    ask("HOLD;EDITLIST;SADD;STAR 1E6;STOP 2E6;POIN 7;SDON;EDITDONE;SWPT LIST;SWPT?")
    (sweep,) = wire.measure(JOINED)
    assert sweep.settings["no_list_sweep"] == "its list-sweep table is in use"
    assert ask("SWPT?") == "LIST"
    assert ask("POIN?") == "7"
    wire.close()


def test_an_instrument_that_takes_the_words_for_others_is_found_out(play):
    """It accepts every mnemonic without an error, but has a single STAR, POIN and level instead of a table."""
    peer = play({"OUTPSWPRM?": [b"nothing\n"]})
    analyzer = open_analyzer(peer.resource, timeout_seconds=0.2)
    with pytest.raises(InstrumentError, match=r"OUTPSWPRM\?"):  # of the single sweep, for which it has no data
        analyzer.measure(JOINED)
    analyzer.close()
    sent = ";".join(peer.log)
    assert "SADD" in sent
    assert "SWPT LIST" not in sent


def test_an_axis_that_is_not_the_plans_is_found_out_and_swept_anew(sim, monkeypatch):
    right = measured(sim)
    real = pzctl.sim.instrument.state.list_axis
    monkeypatch.setattr(
        "pzctl.sim.instrument.state.list_axis",
        lambda table, *more: real(tuple(replace(one, start=one.start + 0.01) for one in table), *more),
    )
    analyzer = open_analyzer(sim.resource)
    for _ in range(2):  # the second time it is known already
        (sweep,) = analyzer.measure(JOINED)
        assert "OUTPSWPRM?: point " in sweep.settings["no_list_sweep"]
        np.testing.assert_allclose(sweep.impedance, right.impedance, rtol=1e-6)
    analyzer.close()


def test_batches_fit_the_table():
    many = SweepPlan(tuple(Segment(k * 1e6, k * 1e6 + 9e5, 60) for k in range(1, 31)), joined=True)
    for batch in batches(many):
        assert len(lines(batch)) <= 18
        assert sum(segment.points for segment in batch) <= 801
    assert tuple(segment for batch in batches(many) for segment in batch) == many.segments
    parts = lines((Segment(1e6, 2e6, 500),))
    assert [line.points for line in parts] == [167, 166, 167]
    points = np.concatenate([np.linspace(line.start_Hz, line.stop_Hz, line.points) for line in parts])
    np.testing.assert_allclose(points, np.linspace(1e6, 2e6, 500), rtol=0, atol=1e-3)
