"""A recording played back as an analyzer: it returns recorded points only, and an error where there are none."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.base.analyzer import Cancelled, InstrumentError
from pzctl.models.sweep_plan import Segment, SweepPlan


@pytest.fixture
def recording(tmp_path):
    f = np.linspace(1e6, 2e6, 11)
    rows = "\n".join(f"{x!r},{x / 1e6!r},{-1e9 / x!r}" for x in map(float, f))
    file = tmp_path / "disk.csv"
    file.write_text(f"frequency_Hz,R_ohm,X_ohm\n{rows}\n")
    return file


def measure(path, *segments, **keywords):
    return open_analyzer(f"recording:{path}").measure(SweepPlan(segments), **keywords)


def test_each_segment_returns_its_recorded_points(recording):
    said = []
    low, all_of_it = measure(recording, Segment(1.05e6, 1.32e6, 801), Segment(1e6, 2e6), progress=said.append)
    np.testing.assert_allclose(low.frequency, [1.1e6, 1.2e6, 1.3e6])
    np.testing.assert_allclose(low.impedance, [1.1 - 1e9j / 1.1e6, 1.2 - 1e9j / 1.2e6, 1.3 - 1e9j / 1.3e6])
    assert "3 recorded points within 1050000 to 1320000 Hz" in low.notes[-1]
    assert len(all_of_it.frequency) == 11
    assert [p.fraction for p in said] == [1.0]


def test_a_folder_is_played_file_by_file(recording):
    shutil.copy(recording, recording.with_name("ml1.csv"))
    (recording.parent / "notes.md").write_text("not a recording")
    analyzer = open_analyzer(f"recording:{recording.parent}")
    plan = SweepPlan((Segment(1e6, 2e6),))
    assert [analyzer.measure(plan)[0].id for _ in range(2)] == ["disk.csv", "ml1.csv"]
    with pytest.raises(InstrumentError, match="all 2 recordings of the folder have been played"):
        analyzer.measure(plan)


def test_what_was_not_recorded_is_not_played(recording):
    with pytest.raises(InstrumentError, match=r"0 of its points lie within .*recorded from 1000000 to 2000000 Hz"):
        measure(recording, Segment(5e6, 6e6))
    with pytest.raises(Cancelled):
        measure(recording, Segment(1e6, 2e6), cancelled=lambda: True)


def test_no_file_and_no_recording_in_the_folder(tmp_path):
    with pytest.raises(InstrumentError, match="no such file or folder"):
        open_analyzer(f"recording:{tmp_path / 'nothing.csv'}")
    with pytest.raises(InstrumentError, match="no recording in this folder"):
        open_analyzer(f"recording:{tmp_path}")


def test_a_recording_identifies_itself(recording):
    identity = open_analyzer(f"recording:{recording}").identify()
    assert identity.model == "recording"
    assert Path(identity.name.removeprefix("recording:")) == recording
