"""A third party's analyzer is installed from its own folder, found by its `*IDN?` reply, and used by the daemon."""

import os
import re
import shutil
import socketserver
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.drivers import capabilities_of, open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

PACKAGE = Path(__file__).parents[2] / "example_analyzer"
GUIDE = Path(__file__).parents[3] / "docs" / "writing-an-analyzer.md"
IDN = "ACME,Z1000,7,1.0"


class Acme(socketserver.StreamRequestHandler):
    """An analyzer that measures 1 nF in series with 2 ohm."""

    def handle(self) -> None:
        for line in self.rfile:
            command, _, words = line.decode().strip().partition(" ")
            if command == "*IDN?":
                self.wfile.write(f"{IDN}\n".encode())
            else:
                f, _ = map(float, words.split(","))
                self.wfile.write(f"2.0,{-1 / (2e-9 * np.pi * f):.9e}\n".encode())


@pytest.fixture
def resource() -> Iterator[str]:
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Acme) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=[0.05], daemon=True).start()
        yield f"127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.fixture
def installed(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example as installed by pip, for this process and its child processes."""
    source, target = tmp_path_factory.mktemp("source") / "package", tmp_path_factory.mktemp("installed")
    shutil.copytree(PACKAGE, source)  # building leaves files in the folder
    words = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", target, source]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, timeout=100)
    monkeypatch.setenv("PYTHONPATH", str(target), prepend=os.pathsep)
    monkeypatch.syspath_prepend(str(target))


@pytest.mark.usefixtures("installed")
def test_the_daemon_measures_with_it(start_daemon, build: Build, resource: str) -> None:
    start_daemon(resource=resource)
    with connect() as lab:
        assert lab.hello().instrument.model == "Z1000"
        plan = SweepPlan((Segment(1e6, 2e6, 5), Segment(1e3, 1e6, 4, "log")))
        low, high = sorted(lab.measure(build, "disk", plan).sweeps, key=lambda sweep: sweep.frequency[0])
        np.testing.assert_allclose(low.frequency, [1e3, 1e4, 1e5, 1e6])
        np.testing.assert_allclose(high.impedance, 2 - 1j / (2e-9 * np.pi * high.frequency))
        assert high.settings["instrument"] == IDN
        (joined,) = lab.measure(
            build, "disk", SweepPlan((Segment(1e6, 2e6, 5), Segment(3e6, 4e6, 5)), joined=True)
        ).sweeps
        assert joined.frequency.size == 10
        with pytest.raises(DaemonError, match="stop is 20000000 Hz; the Z1000 can do 1000 to 10000000 Hz"):
            lab.measure(build, "disk", SweepPlan((Segment(1e6, 20e6),)))
        with pytest.raises(DaemonError, match=r"oscillator is 0\.001 A; a Z1000 can only be set in volts"):
            lab.measure(build, "disk", SweepPlan(plan.segments, oscillator_A=1e-3))


@pytest.mark.usefixtures("installed")
def test_its_abilities_are_known_without_it_and_what_it_does_not_do_is_said(resource: str) -> None:
    assert capabilities_of(IDN).source_ohm == 50.0
    analyzer = open_analyzer(resource)
    with pytest.raises(InstrumentError, match="a Z1000 has no compensation that pzctl can measure"):
        analyzer.compensate(["open"], lambda _: None)
    analyzer.close()


def test_the_guide_shows_the_example_as_it_is() -> None:
    code = (PACKAGE / "example_analyzer.py").read_text(encoding="utf-8")
    shown = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    assert shown
    assert all(block in code for block in shown)
