"""An untrusted file or setting is used, or refused in one sentence, without traceback or endless work."""

import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import BuildError, read_build
from pzctl.daemon.files.config import ConfigError, settings
from pzctl.daemon.server.sockets import EndpointError, access_control_for
from pzctl.drivers import open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.drivers.recordings import RecordingError, read_recording, write_hdf5, write_netcdf
from pzctl.drivers.recordings.atomic_file import sealed
from pzctl.drivers.recordings.columns import read_header
from pzctl.drivers.recordings.text_file import TextFile
from pzctl.models.sweep import Sweep

SWEEP = Sweep(np.linspace(1e6, 2e6, 5), np.full(5, 50 - 10j), {"oscillator_V": 0.5}, id="a")


@pytest.mark.timeout(20)
@pytest.mark.parametrize("name", ["f{}x", "x{}(", "f (Hz{}", "f{}_", "f /{}", "({}(", "_{}/"])
@pytest.mark.parametrize("filling", [" ", "\t", "_", "(", " /", "\u00a0"], ids=ascii)
def test_a_long_column_name_is_read_quickly(name: str, filling: str) -> None:
    page = TextFile(Path("a.csv"), ())
    columns = read_header(page, ["frequency_Hz", name.format(filling * 100_000)], 1)
    assert columns[0].quantity == "f"


def test_units_are_read_with_blanks() -> None:
    names = ["f (MHz)", "R [ ohm ]", "X  /  ohm", "|Z|_ohm", "theta  ( deg )", "Frequency  (Hz)", "G/S"]
    found = read_header(TextFile(Path("a.csv"), ()), names, 1)
    units = [(column.quantity, column.unit, column.factor) for column in found[:5]]
    assert units == [("f", "MHz", 1e6), ("R", "ohm", 1.0), ("X", "ohm", 1.0), ("|Z|", "ohm", 1.0), units[4]]
    assert units[4][:2] == ("theta", "deg")
    assert [column.quantity for column in found[5:]] == ["f", "G"]


def hdf5(change: Callable[[h5py.File], object]) -> bytes:
    """Return a sealed HDF5 file in a layout that pzctl does not write."""
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        for key in ("frequency", "resistance", "reactance"):
            file[key] = SWEEP.frequency
        texts = {"format": "pzctl recording 1", "time": SWEEP.time, "id": "a", "settings": "{}", "notes": "[]"}
        file.attrs.update(texts)
        change(file)
    return sealed(memory.getvalue())


def group(file: h5py.File) -> None:
    del file["resistance"]
    file.create_group("resistance")


def huge(file: h5py.File) -> None:
    del file["frequency"]
    file.create_dataset("frequency", shape=(10**14,), dtype="f8", chunks=(1000,))


def texts(file: h5py.File) -> None:
    del file["frequency"]
    file["frequency"] = ["a", "b"]


ODD: dict[str, Callable[[h5py.File], object]] = {
    "group": group,
    "huge": huge,
    "texts": texts,
    "plane": lambda file: (file.__delitem__("frequency"), file.create_dataset("frequency", data=np.ones((3, 3)))),
    "scalar": lambda file: (file.__delitem__("frequency"), file.create_dataset("frequency", data=1.0)),
    "link": lambda file: (file.__delitem__("frequency"), file.__setitem__("frequency", h5py.SoftLink("/nowhere"))),
    "loop": lambda file: (file.__delitem__("frequency"), file.__setitem__("frequency", h5py.SoftLink("/frequency"))),
    "nested": lambda file: file.attrs.__setitem__("settings", "[" * 50_000),
    "list": lambda file: file.attrs.__setitem__("settings", "[1]"),
    "number": lambda file: file.attrs.__setitem__("notes", "1"),
    "no number": lambda file: file.attrs.__setitem__("settings", '{"oscillator_V": "much"}'),
    "attribute": lambda file: file.attrs.__setitem__("id", h5py.Empty("f")) or file.attrs.__delitem__("time"),
    "not there": lambda file: file.attrs.__delitem__("notes"),
}


@pytest.mark.parametrize("how", ODD)
def test_an_hdf5_file_of_another_layout_is_refused_with_a_sentence(tmp_path: Path, how: str) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(hdf5(ODD[how]))
    with pytest.raises(RecordingError, match=r"a\.h5: not a recording: \S"):
        read_recording(path)


@pytest.mark.parametrize(("write", "suffix"), [(write_netcdf, ".nc"), (write_hdf5, ".h5")])
def test_a_damaged_file_under_a_right_seal_is_refused_with_a_sentence(
    tmp_path: Path, write: Callable[[Sweep, Path], None], suffix: str
) -> None:
    """In a separate process: a crash of the HDF5 library must not end the tests."""
    whole = tmp_path / f"whole{suffix}"
    write(SWEEP, whole)
    program = (
        "import random, sys; from pathlib import Path\n"
        "from pzctl.drivers.recordings import RecordingError, read_recording\n"
        "from pzctl.drivers.recordings.atomic_file import read_sealed, sealed\n"
        "whole = Path(sys.argv[1]); content = read_sealed(whole); dice = random.Random(1)\n"
        "for k in range(300):\n"
        "    damaged = bytearray(content)\n"
        "    for _ in range(8): damaged[dice.randrange(min(len(damaged), 900))] = dice.randrange(256)\n"
        "    path = whole.with_stem('damaged'); path.write_bytes(sealed(bytes(damaged)))\n"
        "    try: read_recording(path)\n"
        "    except RecordingError: pass\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, whole], capture_output=True, text=True, timeout=90, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.timeout(20)
def test_devices_and_pipes_are_no_files(tmp_path: Path) -> None:
    link, pipe = tmp_path / "zero.csv", tmp_path / "pipe.csv"
    link.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    for path in (link, pipe):
        with pytest.raises(RecordingError, match="this is a device or a pipe"):
            read_recording(path)
        with pytest.raises(BuildError, match="this is a device or a pipe"):
            read_build(path)
    for resource in ("recording:/dev/zero", f"recording:{pipe}"):
        with pytest.raises(InstrumentError, match="this is a device or a pipe; a file or a folder"):
            open_analyzer(resource)


def test_a_nul_in_a_path_is_a_sentence() -> None:
    with pytest.raises(BuildError, match="cannot be read"):
        read_build(Path("a\0b.toml"))
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(Path("a\0b.h5"))


@pytest.mark.parametrize(
    "bench", ["x", "host", ":5026", "host:", "host:0", "host:99999", "host:-1", "host:\u0661", "h\0:1"]
)
def test_what_is_no_bench_is_refused(bench: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PZCTL_FITTERS", raising=False)
    with pytest.raises(ConfigError, match=r"--bench is .*; allowed is host:port"):
        settings({"bench": bench})
    assert settings({"bench": "localhost:5026"}) == {"bench": "localhost:5026"}


@pytest.mark.parametrize(
    "endpoint", ["tcp://127.0.0.1:99999", "tcp://127.0.0.1:-1", "tcp://127.0.0.1", "tcp://127.0.0.1:x"]
)
def test_what_is_no_port_is_refused(tmp_path: Path, endpoint: str) -> None:
    with pytest.raises(EndpointError, match=r"does not exist; 0 to 65535 or \* is allowed"):
        access_control_for((endpoint, "tcp://127.0.0.1:*"), tmp_path / "keys")
