"""One recording that is given twice is refused, whatever it is called."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.engine.distinct_recordings import refuse_given_twice
from pzctl.fitters.interface import FitTask, TaskError
from pzctl.fitters.plugins import load_fitter, run
from pzctl.models.sweep import Sweep

ID = "01a2218b-418a-76d3-a88b-4788abee238d"
F = np.array([1e6, 2e6])


@pytest.mark.parametrize("fitter", ["mason", "stack2d"])
def test_one_recording_for_two_steps(cases: Path, fitter: str) -> None:
    build = read_build(cases / "glue-null" / "build.toml")
    disk = read_recording(cases / "glue-null" / "disk.csv")
    renamed = replace(disk, id="ml1.csv", file="ml1.csv")
    says = r"\(disk.csv and ml1.csv\), for steps 'disk' and 'ml1'; each step needs a sweep of its own"
    with pytest.raises(TaskError, match=says):
        run(load_fitter(fitter), FitTask(build, {"disk": (disk,), "ml1": (renamed,)}))


def test_one_id_is_one_recording_and_one_file_name_is_not() -> None:
    one = Sweep(F, np.array([1 - 5j, 2 - 3j]), id=ID)
    other = replace(one, impedance=one.impedance * 1.001)
    with pytest.raises(TaskError, match=f"given twice, noise included .{ID}., for step 'disk'; a repeat is another"):
        refuse_given_twice({"disk": (one, other)})
    refuse_given_twice({"disk": (replace(one, id="1.csv"),), "ml1": (replace(other, id="1.csv"),)})
