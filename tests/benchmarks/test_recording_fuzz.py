"""A hundred thousand damaged recordings (`PZCTL_FUZZ=1000000` for a million): each gives a sweep or a sentence."""

import importlib.util
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pzctl.drivers.recordings import RecordingError, read_memory_trace, read_recording, write_hdf5, write_netcdf
from pzctl.models.sweep import Sweep

FILES = int(os.environ.get("PZCTL_FUZZ", "100000"))


def _accidents() -> ModuleType:
    """The seed files and the defects of the test of the same subject."""
    path = Path(__file__).resolve().parents[1] / "drivers" / "recordings" / "test_recordings_errors.py"
    spec = importlib.util.spec_from_file_location("recording_accidents", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.timeout(0)
def test_damaged_recordings() -> None:
    accidents = _accidents()
    damaged: Callable[[bytes, int], bytes] = accidents.damaged
    seeds = {name: text.encode() for name, text in accidents.SEEDS.items()}
    outcome: Counter[tuple[str, str]] = Counter()
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        sweep = Sweep(np.linspace(1e6, 2e6, 9), np.full(9, 5 - 100j), {"bandwidth": 5}, id="fuzz")
        for write, name in ((write_netcdf, "e.nc"), (write_hdf5, "f.h5")):
            write(sweep, Path(folder) / name)
            seeds[name] = (Path(folder) / name).read_bytes()
        for number in range(FILES):
            name = list(seeds)[number % len(seeds)]
            file = Path(folder) / name
            file.write_bytes(damaged(seeds[name], number))
            try:
                read_recording(file)
                read_memory_trace(file)
            except RecordingError as error:
                outcome[name, "a sentence" if str(error).isprintable() else "unprintable"] += 1
            else:
                outcome[name, "a sweep"] += 1
    seconds = time.perf_counter() - begin
    print(f"\n{FILES} damaged recordings in {seconds:.0f} s, none with any other exception:")
    for (name, what), count in sorted(outcome.items()):
        print(f"  {name:6s} {what:10s} {count}")
    assert all(outcome[name, "a sentence"] for name in seeds)
    assert not any(outcome[name, "unprintable"] for name in seeds)
