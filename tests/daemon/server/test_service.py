"""The daemon through its real sockets: it measures, writes the journal, publishes and fits."""

import numpy as np
import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import home
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

ECHO = "guest_examples:Echo"


def test_the_whole_story(start_daemon, build: Build) -> None:
    start_daemon("Echo")
    with connect() as lab:
        assert lab.hello().instrument.simulated
        heard: list[float] = []
        disk = lab.measure(build, "disk", progress=lambda event: heard.append(event.fraction))
        assert [sweep.frequency.size for sweep in disk.sweeps] == [51, 41]
        assert heard
        assert 0 <= min(heard) <= max(heard) <= 1
        lab.wait_fit(ECHO, disk.id)
        assert lab.bench({"command": "next"})["step"] == "ml1"
        ml1 = lab.measure(build, "ml1", SweepPlan((Segment(2e6, 3e6, 11),)))
        result = lab.wait_fit(ECHO, ml1.id)

        assert result.steps == ("disk", "ml1")
        assert result.constants["disk.Z"].re == abs(ml1.sweeps[0].impedance[0])
        assert [curve.step for curve in result.curves] == ["disk", "disk", "ml1"]
        assert np.array_equal(result.curves[0].measured, disk.sweeps[0].impedance)
        assert np.array_equal(result.curves[2].fitted, 3 * ml1.sweeps[0].impedance)
        (history,) = lab.samples()
        assert [(m.step, m.state, m.fitters) for m in history.measurements] == [
            ("disk", "measured", (ECHO,)),
            ("ml1", "measured", (ECHO,)),
        ]
        assert lab.samples("other") == ()


@pytest.mark.parametrize(
    ("fitter", "says"),
    [
        ("Refuses", "sweep wider"),
        ("Fails", "failed: ZeroDivisionError: oh"),
        ("Nonsense", "its answer was refused: .*chi2_per_dof"),
        ("Dies", "crashed 2 times over this measurement: ended with status 7"),
    ],
)
def test_who_waits_for_a_fit_hears_why_there_is_none(start_daemon, build: Build, fitter: str, says: str) -> None:
    start_daemon(fitter)
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        with pytest.raises(FitError, match=says):
            lab.wait_fit(f"guest_examples:{fitter}", measurement)
        assert lab.measure(build, "disk").sweeps, "the daemon goes on"


def test_a_fitter_that_is_not_there(start_daemon, build: Build) -> None:
    start_daemon("Missing")
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        with pytest.raises(DaemonError, match=r"does not run it; it runs guest_examples:Missing"):
            lab.wait_fit("mason", measurement)
        with pytest.raises((DaemonError, FitError), match="AttributeError: module 'guest_examples' has no attribute"):
            lab.wait_fit("guest_examples:Missing", measurement)


def test_bad_requests_get_a_sentence(start_daemon, build: Build) -> None:
    start_daemon()
    with connect() as lab:
        for ask, says in (
            (lambda: lab.measure(build, "ml9"), r"build 'S4.a' has no step 'ml9'; it has disk, ml1"),
            (lambda: lab.measure(build, "disk", SweepPlan((Segment(1e6, 2e8),))), "110"),
            (lab.cancel, "nothing is being measured"),
            (lambda: lab.fits("nonsense"), "holds no measurement 'nonsense'"),
            (lambda: lab.bench({"command": "dance"}), "no command 'dance'"),
            (lambda: lab.bench({"host": "example.org"}), "no command has a field 'host'"),
        ):
            with pytest.raises(DaemonError, match=says):
                ask()
        assert lab.status().measuring is None


def test_only_loopback_is_bound(start_daemon) -> None:
    with pytest.raises(DaemonError, match=r"tcp://\*:0.* can be reached from other machines; that needs keys"):
        start_daemon(events="tcp://*:0")
    assert not (home() / "daemon.json").exists()


def test_nobody_at_the_resource(start_daemon) -> None:
    with pytest.raises(DaemonError, match=r"TCPIP0::127.0.0.1::9::SOCKET"):
        start_daemon(resource="TCPIP0::127.0.0.1::9::SOCKET")
