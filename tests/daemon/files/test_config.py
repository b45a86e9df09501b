"""Precedence: flag, environment, file, default; errors name the source of the wrong value."""

import json
import logging
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from pzctl.daemon.files.config import SETTINGS, ConfigError, options, settings
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.files.worker_limits import Limits
from pzctl.daemon.server.logs import JsonLines

ROOT = Path(__file__).parents[3]


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    for name in SETTINGS:
        monkeypatch.delenv("PZCTL_" + name.upper(), raising=False)
    return tmp_path / "config.toml"


def test_the_order_of_precedence(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert options(settings({})) == DaemonOptions(simulator={"time_scale": 1.0, "seed": 0})
    file.write_text('resource = "A"\nfitters = ["mason"]\nseed = 1\nfit_seconds = 10\n', encoding="utf-8")
    monkeypatch.setenv("PZCTL_RESOURCE", "B")
    monkeypatch.setenv("PZCTL_FITTERS", "bvd, disk")
    found = options(settings({"resource": "C", "fitters": None, "fit_memory_MB": 100}))
    assert (found.resource, found.fitters, found.simulator["seed"]) == ("C", ("bvd", "disk"), 1)
    assert found.limits == Limits(seconds=10.0, memory_MB=100)
    assert options(settings({})).resource == "B"
    monkeypatch.delenv("PZCTL_RESOURCE")
    assert options(settings({})).resource == "A"


@pytest.mark.parametrize(
    ("text", "variable", "says"),
    [
        ("resourse = 1", None, r"config.toml: resourse: no such setting; there are resource"),
        ("fit_seconds = -1", None, r"config.toml: fit_seconds is -1; allowed is seconds above 0"),
        ("fitters = 5", None, r"fitters is 5; allowed is names of fitters"),
        ("resource = ", None, r"config.toml: cannot be read: "),
        ("", ("PZCTL_SEED", "x"), r"PZCTL_SEED is 'x'; allowed is a whole number"),
        ("", ("PZCTL_LOG", "xml"), r"PZCTL_LOG is 'xml'; allowed is text or json"),
    ],
)
def test_what_is_wrong_is_said(file: Path, monkeypatch, text: str, variable: tuple[str, str] | None, says: str) -> None:
    file.write_text(text, encoding="utf-8")
    if variable:
        monkeypatch.setenv(*variable)
    with pytest.raises(ConfigError, match=says):
        settings({})


def test_the_log_for_programs() -> None:
    record = logging.LogRecord("pzctl.daemon", logging.INFO, "f", 1, "hello %s\nthere", ("ö",), None)
    (line,) = JsonLines().format(record).splitlines()
    said = json.loads(line)
    assert (said["level"], said["logger"], said["message"]) == ("info", "pzctl.daemon", "hello ö\nthere")


def test_every_setting_is_in_the_docs() -> None:
    text = (ROOT / "docs" / "service.md").read_text(encoding="utf-8")
    names = [f"`{name}`" for name in SETTINGS]
    names += [f"`PZCTL_{name.upper()}`" for name, setting in SETTINGS.items() if setting.is_text]
    assert not [name for name in names if name not in text]


def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("there is no systemd-analyze here")
    text = (ROOT / "docs" / "pzctl.service").read_text(encoding="utf-8")
    (tmp_path / "pzctl.service").write_text(text.replace("/opt/pzctl/bin/pzctl", shutil.which("true") or ""))
    done = subprocess.run(
        ["systemd-analyze", "verify", tmp_path / "pzctl.service"],
        env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
