"""Error sentences about a misbehaving 4294A: what, where, what was found, what is allowed."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.drivers.agilent4294a.instrument import Agilent4294A
from pzctl.drivers.agilent4294a.limits import check
from pzctl.drivers.base import compensation_file
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.drivers.base.compensation import Compensation
from pzctl.drivers.recordings import RecordingError, read_data_trace, read_recording, write_netcdf
from pzctl.drivers.recordings.formats import netcdf_hdf5 as archive
from pzctl.drivers.recordings.formats.datatrace import _GAP, _POINT, _PREAMBLE
from pzctl.models.base.errors import PzctlError
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import Segment, SweepPlan

from .conftest import IDN

PLAN = SweepPlan((Segment(1e6, 1.5e6, 3),))
STORED = Compensation({"open": np.array([1e-9 + 1e-6j])}, "M1", "2026-11-22T00:00:00Z", IDN.decode().strip())
Work = Callable[[Agilent4294A], object]


def block(*values: float) -> bytes:
    data = np.asarray(values, dtype=">f8").tobytes()
    return b"#6%06d" % len(data) + data + b"\n"


READ = {"OUTPSWPRM?": [block(1e6, 1.25e6, 1.5e6)], "OUTPDATA?": [block(1, -1, 1, -1, 1, -1)]}


def sweep(analyzer: Agilent4294A) -> object:
    return analyzer.measure(PLAN)


def joined(analyzer: Agilent4294A) -> object:
    return analyzer.measure(SweepPlan((Segment(1e6, 1.2e6, 3), Segment(1.5e6, 1.6e6, 3)), joined=True))


def compensate(analyzer: Agilent4294A) -> object:
    return analyzer.compensate(["open"], lambda _: None, adapter="M1")


def cancelled(analyzer: Agilent4294A) -> object:
    return analyzer.compensate(["open"], lambda _: None, cancelled=lambda: True, adapter="M1")


def apply(analyzer: Agilent4294A) -> object:
    return analyzer.restore(STORED)


def apply_that_of_another(analyzer: Agilent4294A) -> object:
    return analyzer.restore(Compensation(STORED.arrays, "M1", STORED.taken, "HP,4294A,JP1KG00001,REV1.11"))


def unknown_standard(analyzer: Agilent4294A) -> object:
    standards: Any = ["thru"]
    return analyzer.compensate(standards, lambda _: None, adapter="M1")


def with_bias(analyzer: Agilent4294A) -> object:
    return analyzer.measure(SweepPlan(PLAN.segments, bias_V=4.0))


def fetch(analyzer: Agilent4294A) -> object:
    return analyzer.fetch("ascii")


def ask_unplugged(analyzer: Agilent4294A) -> object:
    analyzer._link._resource.close()  # as when the bus is unplugged
    return analyzer._link.ask("*IDN?")


@pytest.mark.parametrize(
    ("work", "answers", "says"),
    [
        (
            unknown_standard,
            {},
            "compensation: no standard ['thru']; there are open, short, load",
        ),
        (sweep, {"SING": [b""], "*ESR?": [b"16\n"]}, "SING was refused (event status register 16)"),
        (sweep, {"DCO?": [b"1\n"]}, "the DC bias is still ON after DCO OFF; switch it off at the front panel"),
        (
            sweep,
            {"*IDN?": [IDN, b"HEWLETT-PACKARD,4395A,MY41101925,REV1.12\n"]},
            "4395A,MY41101925,REV1.12'; this driver needs an HP, Agilent or Keysight 4294A",
        ),
        (sweep, {"*IDN?": [IDN, 5000 * b"x"]}, "the answer to *IDN? does not end; garbage on the line?"),
        (sweep, {"*STB?": [b"300\n"]}, "the status byte is 300; 0 to 255 is allowed"),
        (with_bias, {"DCO?": [b"0\n"]}, "the DC bias of 4 V did not come on; reported: no error"),
        (sweep, {"HOLD": [b""]}, "it goes on sweeping after HOLD"),
        (
            sweep,
            {"CONT?": [b"1\n", b"0\n", b"1\n"]} | READ,
            "it sweeps again before its data were read; was a key pressed?",
        ),
        (sweep, {"*OPC?": [b"0\n"]}, "*OPC? is answered by '0'; 1 is expected"),
        (
            sweep,
            {"OUTPERRO?": [b'137,"SEARCHING"\n']},
            "the error queue does not get empty; last was error 137 (SEARCHING)",
        ),
        (cancelled, {}, "the open compensation was cancelled; the instrument is in HOLD, its bias off"),
        (compensate, {"OUTPCOMC1?": [block()]}, "OUTPCOMC1?: no open compensation is stored"),
        (apply, {"OUTPCOMC1?": [block(1.0, 2.0)]}, "the stored open compensation does not read back as written"),
        (
            apply_that_of_another,
            {},
            "this compensation was measured by HP,4294A,JP1KG00001,REV1.11; the instrument here is "
            "HEWLETT-PACKARD,4294A,MY43202956,REV1.11",
        ),
        (
            fetch,
            {'FSIZE? "pzctl.txt"': [b"24\n"], "READ?": [block(1.0), block()]},
            "pzctl.txt ends after 8 bytes; 24 bytes were announced",
        ),
        (
            fetch,
            {'FSIZE? "pzctl.txt"': [b"12\n"], "READ?": [block(1.0)]},
            "16 bytes of pzctl.txt came; 12 bytes were announced",
        ),
        (joined, {"*ESR?": [b"0\n", b"32\n"]}, "was refused (event status register 32)"),
        (ask_unplugged, {}, "sending *IDN? failed: Invalid session handle. The resource might be closed."),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_an_instrument_that_does_what_it_should_not(play, work: Work, answers: dict, says: str) -> None:
    peer = play(answers)
    analyzer = open_analyzer(peer.resource, timeout_seconds=0.6)
    assert isinstance(analyzer, Agilent4294A)
    try:
        with pytest.raises(InstrumentError) as caught:
            work(analyzer)
    finally:
        analyzer.close()
    assert says in str(caught.value)


def test_an_instrument_that_stays_in_hold_is_told_in_the_notes_of_a_sound_sweep(play) -> None:
    analyzer = open_analyzer(play({"CONT": [b""]} | READ).resource, timeout_seconds=0.6)
    (found,) = analyzer.measure(PLAN)
    analyzer.close()
    assert found.notes[-1].startswith("The instrument could not be left as found: ")
    assert found.notes[-1].endswith("it does not go on sweeping after CONT")


def test_an_archive_of_another_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "FORMAT", "pzctl recording 9")
    write_netcdf(Sweep(np.array([1e6, 2e6]), np.array([1j, 2j])), tmp_path / "a.nc")
    monkeypatch.undo()
    with pytest.raises(RecordingError, match=r"a\.nc: its format is 'pzctl recording 9'; 'pzctl recording 1'"):
        read_recording(tmp_path / "a.nc")


@pytest.mark.parametrize(
    ("work", "says"),
    [
        (
            lambda _: check(replace(PLAN, direction="back")),
            "sweep plan: direction 'back' is not known; up or down is allowed",
        ),
        (
            lambda _: check(SweepPlan((Segment(1e6, 2e6, 3, "cubic"),))),  # type: ignore[arg-type]
            "sweep plan: spacing 'cubic' is not known; linear or log is allowed",
        ),
        (
            lambda folder: compensation_file.save(folder / "no" / "c.json", STORED, "4294A"),
            "c.json: the compensation cannot be written: No such file or directory",
        ),
        (
            lambda folder: compensation_file.load(emptied(folder), CAPABILITIES),
            "c.json: the compensation holds no values for open",
        ),
        (
            lambda folder: write_netcdf(replace(SWEEP, id="a\0b"), folder / "a.nc"),
            "recording 'a?b' cannot be written: a text contains a NUL character",
        ),
        (
            lambda folder: read_data_trace(traced(folder), np.array([1e6]), "ABCD"),
            "d.dat: measurement parameter 'ABCD' is not known; IMPH is one",
        ),
    ],
)
def test_plans_and_files(tmp_path: Path, work: Callable[[Path], object], says: str) -> None:
    with pytest.raises(PzctlError) as caught:
        work(tmp_path)
    assert str(caught.value).endswith(says)


SWEEP = Sweep(np.array([1e6, 2e6]), np.array([1j, 2j]))


def emptied(folder: Path) -> Path:
    path = folder / "c.json"
    compensation_file.save(path, STORED, "4294A")
    path.write_text(re.sub(r'"open":\[.*?\]\]', '"open":[]', path.read_text()))
    return path


def traced(folder: Path) -> Path:
    """A binary data trace of one point."""
    path = folder / "d.dat"
    path.write_bytes(bytes(_PREAMBLE + _GAP + 2 * _POINT))
    return path
