"""Where the recordings of others lie; tests that need them skip with a reason where they are absent."""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: parallel tests share two cores
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    sys.dont_write_bytecode = False  # else each of a thousand processes compiles the package anew

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def _folder(variable: str, default: str) -> Path:
    folder = Path(os.environ.get(variable, ROOT / ".." / "shared" / default)).resolve()
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent; set {variable} to the folder of {default}")
    return folder


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings by others."""
    return _folder("PZCTL_RECORDINGS", "recordings")


@pytest.fixture(scope="session")
def cases() -> Path:
    """The folder of open cases: devices of an independent world, with their truth."""
    return _folder("PZCTL_CASES", "cases")
