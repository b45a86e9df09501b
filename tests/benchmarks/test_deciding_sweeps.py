"""`pzctl measure --diagnose --yes` as in its guide: a sweep decides what one leaves open, among the whole catalogue."""

import json
import re
from collections.abc import Callable
from pathlib import Path

from command_line import run_pzctl
from daemon_fixtures import start_daemon

from pzctl.daemon.client.location import Location

__all__ = ["start_daemon"]

RESOURCE = "--resource 127.0.0.1:5835"
FEW = "diagnose --effects stray-capacitance,surface-layer --build"
"""Of a recording that was diagnosed before, among the whole catalogue."""
GUIDE = (Path(__file__).parents[2] / "docs" / "when-the-fit-is-wrong.md").read_text(encoding="utf-8")
BUILD = re.search(r"<!-- file: S1.toml -->\n```toml\n(.*?)```", GUIDE, re.DOTALL)[1]  # type: ignore[index]
BLOCKS = re.findall(rf"<!-- tested: \S+{Path(__file__).name} -->\n```bash\n(.*?)```", GUIDE, re.DOTALL)


def test_a_wider_sweep_decides_what_one_sweep_leaves_open(
    start_daemon: Callable[..., Location],
    tmp_path: Path,
) -> None:
    """As in the guide, command by command; only the simulator is that of the daemon."""
    start_daemon(names=("mason",), simulator={"hidden": {"stray-capacitance": 5e-12}, "jig": "ideal"})
    (tmp_path / "S1.toml").write_text(BUILD)
    sim, *commands = re.findall("^pzctl (.*)$", "".join(BLOCKS), re.MULTILINE)
    assert sim.endswith("--jig ideal --hidden stray-capacitance=5e-12 &")
    (measure,) = (command for command in commands if command.startswith("measure"))
    outputs = {
        command: run_pzctl(tmp_path, *command.replace(RESOURCE, "--json").replace("diagnose --build", FEW).split())
        for command in commands
    }
    assert {"S1.html", "S1-disk-1.csv", "S1-diagnosis.png"} <= {path.name for path in tmp_path.iterdir()}
    (found,) = json.loads(outputs[measure].stdout)["diagnoses"]
    (finding,) = found["findings"]
    assert (found["verdict"], finding["effect"]) == ("explained", "stray-capacitance")
    (sweep,) = found["decided_by"]
    assert "wider" in sweep["kind"], "none is made for the same effects again"
    assert not [one for one in finding["alternatives"] if one["probability"] > 0.01]
    size = finding["parameters"]["capacitance"]
    assert abs(size["value"] - 5e-12) < max(5 * size["u"], 0.03 * 5e-12)
