"""Written files are read back exactly, by pzctl and by others; no file is ever half written."""

import dataclasses
import json
import math
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import netcdf_file

from pzctl.drivers.recordings import (
    RecordingError,
    read_recording,
    write_csv,
    write_hdf5,
    write_netcdf,
    write_touchstone,
)
from pzctl.drivers.recordings.atomic_file import sealed
from pzctl.models.sweep import Sweep

FREQUENCIES = st.lists(st.floats(40, 1e9), min_size=2, max_size=9, unique=True).map(sorted)
PARTS = st.floats(-1e29, 1e29).filter(lambda x: abs(x) > 1e-30)
PLAIN = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False, allow_infinity=False), st.text())
NUMBER = st.one_of(st.none(), st.integers(0, 300), st.floats(0, 1e3))
SETTINGS = st.fixed_dictionaries(
    {"bandwidth": st.integers(1, 5), "oscillator_V": NUMBER},
    optional={"adapter": st.text(), "noise": st.lists(st.floats(0, 1)), "sweeps": st.dictionaries(st.text(), PLAIN)},
)


@st.composite
def sweeps(draw: st.DrawFn) -> Sweep:
    f = draw(FREQUENCIES)
    z = [complex(draw(PARTS), draw(PARTS)) for _ in f]
    if 2 * sum(v.real < 0 for v in z) > len(z):  # the reader would add a note
        z = [-v for v in z]
    texts = tuple(dict.fromkeys(draw(st.lists(st.text(), max_size=2))))
    return Sweep(np.array(f), np.array(z), draw(SETTINGS), draw(st.text()), draw(st.text()), texts)


@settings(max_examples=60, deadline=None)
@given(sweep=sweeps())
def test_csv_round_trips_exactly(tmp_path_factory: pytest.TempPathFactory, sweep: Sweep) -> None:
    file = tmp_path_factory.getbasetemp() / "round.csv"
    write_csv(sweep, file)
    back = read_recording(file)
    assert back.frequency.tobytes() == sweep.frequency.tobytes()
    assert back.impedance.tobytes() == sweep.impedance.tobytes()
    assert (back.settings, back.time, back.id, back.notes) == (sweep.settings, sweep.time, sweep.id, sweep.notes)


PRINTABLE = st.text(st.characters(exclude_categories=["C"]))


@settings(max_examples=40, deadline=None)
@given(sweep=sweeps(), time=PRINTABLE, id_=PRINTABLE, write=st.sampled_from([write_netcdf, write_hdf5]))
def test_archives_round_trip_exactly(
    tmp_path_factory: pytest.TempPathFactory, sweep: Sweep, time: str, id_: str, write: Any
) -> None:
    sweep = dataclasses.replace(sweep, time=time, id=id_)
    file = tmp_path_factory.getbasetemp() / ("round.nc" if write is write_netcdf else "round.h5")
    write(sweep, file)
    back = read_recording(file)
    assert back.frequency.tobytes() == sweep.frequency.tobytes()
    assert back.impedance.tobytes() == sweep.impedance.tobytes()
    assert (back.settings, back.time, back.id, back.notes) == (sweep.settings, sweep.time, sweep.id, sweep.notes)


def a_sweep(**change: Any) -> Sweep:
    f = np.linspace(1e6, 3e6, 201)
    z = 5 + 1 / (2j * np.pi * f * 1e-9)
    rest = {"settings": {"bandwidth": 5, "adapter": "7 mm"}, "time": "2026-01-02T03:04:05.000Z", "id": "S4"}
    return Sweep(f, z, **(rest | change))


def test_a_large_file_too(tmp_path: Path) -> None:
    f = np.linspace(1e3, 1e8, 20_000)
    sweep = Sweep(f, 1 / (1j * f) + 1, {"noise_relative": (1e-5 * np.sqrt(f)).tolist()})
    for write, name in ((write_csv, "a.csv"), (write_netcdf, "a.nc"), (write_hdf5, "a.hdf5")):
        write(sweep, tmp_path / name)
        back = read_recording(tmp_path / name)
        assert np.array_equal(back.impedance, sweep.impedance)
        assert back.settings == sweep.settings


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"accuracy": "good"}, "accuracy is good; a number from 1e-06 to 0.1"),
        ({"noise_relative": [1e-4]}, "noise_relative has 1 value(s), the recording 201 points"),
    ],
)
def test_a_setting_that_no_fit_can_use_is_refused_in_archives_too(
    tmp_path: Path, given: dict[str, Any], says: str
) -> None:
    for write, name in ((write_netcdf, "a.nc"), (write_hdf5, "a.h5"), (write_touchstone, "a.s1p")):
        write(a_sweep(settings=given), tmp_path / name)
        with pytest.raises(RecordingError, match=re.escape(says)):
            read_recording(tmp_path / name)


def test_scikit_rf_reads_our_touchstone(tmp_path: Path) -> None:
    sweep, file = a_sweep(), tmp_path / "a.s1p"
    write_touchstone(sweep, file)
    import skrf  # imported late: it takes half a second, in each process of a test run

    network = skrf.Network(str(file))
    np.testing.assert_allclose(network.f, sweep.frequency, rtol=1e-14)
    np.testing.assert_allclose(network.z[:, 0, 0], sweep.impedance, rtol=1e-12)
    back = read_recording(file)
    np.testing.assert_allclose(back.impedance, sweep.impedance, rtol=1e-13)
    assert (back.settings, back.time, back.id) == (sweep.settings, sweep.time, sweep.id)


def test_netcdf_has_units_and_provenance(tmp_path: Path) -> None:
    sweep, file = a_sweep(notes=("A note.",)), tmp_path / "a.nc"
    write_netcdf(sweep, file)
    with netcdf_file(file, mmap=False) as data:
        z = data.variables["resistance"][:] + 1j * data.variables["reactance"][:]
        assert np.array_equal(z, sweep.impedance)
        assert data.variables["frequency"].units == b"Hz"
        assert data.variables["reactance"].units == b"ohm"
        assert json.loads(data.settings) == sweep.settings
        assert json.loads(data.notes) == ["A note."]


def test_hdf5_has_units_scale_and_provenance(tmp_path: Path) -> None:
    sweep, file = a_sweep(notes=("A note.",)), tmp_path / "a.h5"
    write_hdf5(sweep, file)
    with h5py.File(file) as data:
        assert np.array_equal(data["resistance"][:] + 1j * data["reactance"][:], sweep.impedance)
        assert {name: data[name].attrs["units"] for name in data} == {
            "frequency": "Hz",
            "resistance": "ohm",
            "reactance": "ohm",
        }
        assert np.array_equal(data["reactance"].dims[0][0][:], sweep.frequency)
        assert json.loads(data.attrs["settings"]) == sweep.settings


@pytest.mark.parametrize("name", ["a.nc", "a.h5"])
def test_an_archive_that_is_not_as_it_was_written(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    (write_netcdf if name == "a.nc" else write_hdf5)(a_sweep(), file)
    whole = file.read_bytes()
    file.write_bytes(whole[:-900])
    with pytest.raises(RecordingError, match="no seal at its end: it is cut off, or from another program"):
        read_recording(file)
    for at in range(0, len(whole) - 200, 211):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        with pytest.raises(RecordingError, match="damaged, or was changed since pzctl wrote it"):
            read_recording(file)
    file.write_bytes(sealed(b"CDF\x01" + bytes(40) if name == "a.nc" else b"\x89HDF\r\n\x1a\n" + bytes(400)))
    with pytest.raises(RecordingError, match="not a recording: "):
        read_recording(file)


@pytest.mark.parametrize("value", [math.nan, object(), [math.inf], np.arange(3)])
def test_what_no_file_can_hold_is_refused_and_nothing_is_written(tmp_path: Path, value: object) -> None:
    file = tmp_path / "a.csv"
    write_csv(a_sweep(), file)
    before = file.read_bytes()
    for write in (write_csv, write_touchstone, write_netcdf, write_hdf5):
        with pytest.raises(RecordingError, match="not a finite plain value"):
            write(a_sweep(settings={"x": value}), file)
    with pytest.raises(RecordingError, match="its name is not allowed"):
        write_csv(a_sweep(settings={"note": 1}), file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file], "no partial file stays behind"


def test_a_place_where_nothing_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be written: No such file or directory"):
        write_csv(a_sweep(), tmp_path / "absent" / "a.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(RecordingError, match="cannot be written"):
        write_csv(a_sweep(), tmp_path / "folder.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["folder.csv"]
    f = np.array([1e6, 2e6])
    with pytest.raises(RecordingError, match="-50 ohm has no reflection"):
        write_touchstone(Sweep(f, np.array([-50 + 0j, 1])), tmp_path / "a.s1p")
