"""Diagnoses of a finite disk and of the same with a glued matching layer, by general finite elements.

`python tests/benchmarks/test_glued_disk_diagnosis.py FOLDER [SEED ...]` makes the recordings of these numbers in
FOLDER, diagnoses those that FOLDER/results.jsonl does not have yet, and prints a line each. Odd numbers have a pocket
of air in the glue.
"""

import json
import os
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from glued_disk_world import written_glued

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.interface import FitTask


def diagnosed(seed, folder):
    """Return the judgement of one case."""
    case, own = written_glued(seed, folder), folder / f"case-{seed:03d}"
    sweeps = {step: (read_recording(own / f"{step}.csv"),) for step in ("disk", "ml1")}
    began = time.process_time()
    said = diagnose(FitTask(read_build(own / "build.toml"), sweeps))
    seconds, found = time.process_time() - began, {one.effect: one for one in said.findings}
    right = {"lateral-modes", "unknown", *(["loss-dispersion"] if case.disk.law == "power" else [])}
    right |= {"bond-void"} if case.pocket else set()
    true = {
        "glue1.thickness": case.glue_thickness,
        "ml1.z": case.matching.z,
        "ml1.c": case.matching.speed,
        "ml1.thickness": case.matching_thickness,
    }
    told = {name: said.final.constants.get(name) for name in true}
    return {
        "seed": seed,
        "ratio": case.disk.diameter / case.disk.thickness,
        "law": case.disk.law,
        "pocket": case.pocket**2,
        "verdict": said.verdict,
        "named": [[one.effect, one.where, one.probability] for one in said.findings],
        "right": "lateral-modes" in found and ("bond-void" in found) == (case.pocket > 0),
        "false": [one.effect for one in said.findings if one.effect not in right and one.probability >= 0.9],
        "size": found["bond-void"].parameters["fraction"].value if "bond-void" in found else None,
        "chi2": said.final.chi2_per_dof,
        "off": {name: (one.re - true[name]) / one.u_re for name, one in told.items() if one is not None and one.u_re},
        "seconds": seconds,
    }


def told(one):
    """Return a line on a case."""
    named = ", ".join(f"{name} at {where} {p:.2f}" for name, where, p in one["named"])
    size = "" if one["size"] is None else f", open {one['size']:.4f}"
    off = ", ".join(f"{name} {u:+.1f}" for name, u in one["off"].items())
    return (
        f"{one['seed']:3d} D/t {one['ratio']:4.1f} {one['law']:8s} pocket {one['pocket']:.4f}{size} "
        f"{'right' if one['right'] else '-----'} {one['verdict']:16s} chi2 {one['chi2']:.3g}, {one['seconds']:.0f} s: "
        f"{named}; u off: {off}" + (f"  FALSE {one['false']}" if one["false"] else "")
    )


@pytest.mark.timeout(1200)
def test_a_pocket_of_air_in_the_glue_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    one = diagnosed(601, tmp_path)
    with capsys.disabled():
        print(told(one))
    assert one["right"]
    assert not one["false"]
    assert one["size"] == pytest.approx(one["pocket"], rel=0.05)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    os.environ.setdefault("PZCTL_HOME", str(folder / "home"))
    results = folder / "results.jsonl"
    have = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    for seed in [int(text) for text in sys.argv[2:]]:
        if all(one["seed"] != seed for one in have):
            have.append(diagnosed(seed, folder))
            with results.open("a") as file:
                file.write(json.dumps(have[-1]) + "\n")
            print(told(have[-1]), flush=True)
