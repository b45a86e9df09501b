"""The examples of the guides that name an instrument or the reader's files, run with a simulated instrument.

Indented examples are for the reader's bench; here their addresses are those of the simulator, and their files are
recordings made with it; that of an equivalent circuit is one of a circuit.
"""

import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimOptions, running

DOCS = Path(__file__).resolve().parents[1] / "docs"
PZCTL = str(Path(sys.executable).with_name("pzctl"))
INDENTED = re.compile(r"^    pzctl ([^#\n]*)", re.MULTILINE)
S4 = re.compile(r"<!-- file: S4.toml -->\n```toml\n(.*?)```", re.DOTALL)
GUIDES = ("connecting-a-4294A", "first-measurement", "when-the-fit-is-wrong", "diagnosis")
ELSEWHERE = {
    "doctor": "tests/daemon/cli/test_show_export_doctor.py",
    "measure --diagnose": "tests/daemon/cli/test_measure_diagnose.py",
}
"""The tests that run commands which take too long to be run twice."""


class Bench:
    """A folder with a transducer's description and recordings, and a simulated instrument."""

    def __init__(self, folder: Path, resources: dict[str, str]) -> None:
        self.folder, self.resources = folder, resources
        self.environment = {**os.environ, "PZCTL_HOME": str(folder / "home")}

    def pzctl(self, *words: str) -> None:
        words = tuple(self.resources.get(word, word) for word in words)
        done = subprocess.run(
            [PZCTL, *words], cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"pzctl {shlex.join(words)}\n{done.stdout[-800:]}\n{done.stderr[-800:]}"
        assert "Traceback" not in done.stderr


def _a_circuit() -> str:
    """Return a recording of a device with one resonance, which its circuit describes: nothing has to be searched."""
    f = np.linspace(0.6e6, 1.6e6, 101)
    Z = Lumped(1e-9, (Branch.from_resonance(1e6, 80, 1.5e-10),), tan_delta=0.01).impedance(f)
    Z = Z * np.exp(2e-4 * np.random.default_rng(3).normal(size=(2, f.size)).T @ [1, 1j])
    rows = [f"{at:.1f},{z.real:.9g},{z.imag:.9g}" for at, z in zip(f, Z, strict=True)]
    return "\n".join(["frequency_Hz,R_ohm,X_ohm", *rows, ""])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("bench")
    found = S4.search((DOCS / "transducer.md").read_text(encoding="utf-8"))
    assert found
    text = found[1].replace("801", "41")
    for name in ("S4.toml", "build.toml"):
        (folder / name).write_text(text, encoding="utf-8")
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, prologix_port=0, jig="ideal")) as sim:
        by_name = {
            "TCPIP0::192.168.0.17::5025::SOCKET": sim.resource,
            "192.168.0.17:5025": f"127.0.0.1:{sim.port}",
            "GPIB0::17::INSTR": f"PROLOGIX::127.0.0.1:{sim.prologix_port}::17",
        }
        made = Bench(folder, by_name)
        bench_command("127.0.0.1", sim.bench_port, command="step", name="disk")
        with socket.create_connection(("127.0.0.1", sim.port)) as by_hand:
            by_hand.sendall(b"STAR 2E6\nSTOP 8E6\nPOIN 401\n")
        made.pzctl("screenshot", "disk.txt", "--resource", sim.resource)
        for step in ("disk", "ml1"):
            bench_command("127.0.0.1", sim.bench_port, command="step", name=step)
            made.pzctl("measure", "--build", "S4.toml", "--step", step, "--resource", sim.resource, "--quiet")
        made.pzctl("daemon", "--stop")
        made.pzctl("export", "S4")
        for old, new in (("disk-1", "disk"), ("ml1-2", "ml1"), ("ml1-1", "ml1-first")):
            shutil.copy(folder / f"S4-{old}.csv", folder / f"{new}.csv")
        shutil.copy(folder / "S4-ml1-2.csv", folder / "ml1-second.csv")
        (folder / "RB5100.txt").write_text(_a_circuit(), encoding="utf-8")
        rows = [line for line in (folder / "disk.csv").read_text(encoding="utf-8").splitlines() if line[:1].isdigit()]
        (folder / "table.txt").write_text("\n".join(" ".join(row.split(",")[:3]) for row in rows), encoding="utf-8")
        bench_command("127.0.0.1", sim.bench_port, command="new-sample", seed=1)
        yield made
        subprocess.run([PZCTL, "daemon", "--stop"], env=made.environment, capture_output=True, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX end the daemon")
@pytest.mark.parametrize("guide", GUIDES)
def test_an_example_with_an_instrument_or_with_files(bench: Bench, guide: str) -> None:
    lines = INDENTED.findall((DOCS / f"{guide}.md").read_text(encoding="utf-8"))
    assert lines
    for line in map(str.strip, lines):
        if line in ELSEWHERE or "..." in line:
            continue
        few = ("--effects", "lead-inductance") if line.startswith("diagnose") and "--effects" not in line else ()
        bench.pzctl(*shlex.split(line), *few)  # the second of ELSEWHERE tries the whole catalogue
        if "--resource" in line and line.startswith("measure"):
            bench.pzctl("daemon", "--stop")  # the next example uses another instrument


def test_commands_run_elsewhere_are_in_those_tests() -> None:
    for file in ELSEWHERE.values():
        assert (DOCS.parent / file).exists()
