"""Operation of the daemon: rights of its unit and container, access to its metrics, and a restored backup."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import run_here
from page_requests import ask

from pzctl.daemon.cli.commands import app
from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.backup_plan import BackupPlan
from pzctl.daemon.page.page_users import PageUsers, add_user
from pzctl.models.build import Build

ROOT = Path(__file__).resolve().parents[2]
UNIT = ROOT / "docs" / "pzctl.service"
PZCTL = Path(sys.executable).with_name("pzctl")

MOST_EXPOSED = 15
"""Exposure by `systemd-analyze security` in tenths: 100 is no protection at all."""


def unit() -> dict[str, list[str]]:
    """Return the values of each key of the unit."""
    found: dict[str, list[str]] = {}
    for name, value in re.findall(r"^(\w+)=(.*)$", UNIT.read_text(encoding="utf-8"), re.MULTILINE):
        found.setdefault(name, []).append(value)
    return found


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("ProtectSystem", "strict"),
        ("ReadWritePaths", "/var/lib/pzctl"),
        ("ProtectHome", "yes"),
        ("PrivateTmp", "yes"),
        ("NoNewPrivileges", "yes"),
        ("CapabilityBoundingSet", ""),
        ("MemoryMax", "8G"),
        ("MemoryDenyWriteExecute", "yes"),
        ("SystemCallFilter", "@system-service"),
        ("RestrictAddressFamilies", "AF_UNIX AF_INET AF_INET6"),
        ("UMask", "0077"),
    ],
)
def test_the_unit_removes_rights_that_the_daemon_does_not_need(key: str, value: str) -> None:
    assert unit()[key][0] == value


def test_the_unit_may_write_where_the_daemon_keeps_its_data_and_nowhere_else() -> None:
    homes = [value.removeprefix("PZCTL_HOME=") for value in unit()["Environment"] if value.startswith("PZCTL_HOME=")]
    assert homes == unit()["ReadWritePaths"]
    assert unit()["RestartPreventExitStatus"] == ["2"], "wrong usage does not cause a restart"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd here")
def test_systemd_finds_the_unit_little_exposed() -> None:
    command = ["systemd-analyze", "security", "--offline=yes", f"--threshold={MOST_EXPOSED}", UNIT]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout[-3000:] + ran.stderr
    assert "Unknown" not in ran.stderr, "a key that systemd does not know protects nothing"


STEPS = [
    (line.split(maxsplit=1)[0], line.split(maxsplit=1)[1])
    for line in (ROOT / "docs" / "Containerfile").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
]
"""Instruction and arguments of each line."""


def test_the_container_is_built_from_existing_files_and_misses_none() -> None:
    copied = [shlex.split(words) for step, words in STEPS if step == "COPY" and not words.startswith("--from")]
    sources = {source for *of_step, _ in copied for source in of_step}
    assert [source for source in sources if not (ROOT / source).exists()] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = {name.split(".")[1] for name in project["tool"]["setuptools"]["packages"] if "." in name}
    assert packages | {"pyproject.toml", "__init__.py", project["project"]["readme"]} <= sources


def test_the_container_installs_extras_and_runs_commands_that_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (extras,) = re.findall(r'"\.\[([\w,]+)\]"', "\n".join(words for step, words in STEPS if step == "RUN"))
    assert {*extras.split(",")} <= {*project["optional-dependencies"]}
    told = dict(STEPS)
    commands = {command.name for command in app.registered_commands}
    (program,) = json.loads(told["ENTRYPOINT"])
    checked, what, *_ = json.loads(told["HEALTHCHECK"].partition("CMD ")[2])
    assert {program, checked} <= {*project["scripts"]}
    assert {json.loads(told["CMD"])[0], what} <= commands
    assert told["USER"] == "pzctl", "not root"


def test_the_steps_of_the_container_install_a_daemon_that_reports_its_health(
    start_program: Callable[..., "subprocess.Popen[bytes]"], tmp_path: Path, wait_until: Callable[..., None]
) -> None:
    """The instructions in their order, with a folder in place of the image and this environment's libraries."""
    source, image, data = tmp_path / "src", tmp_path / "image", tmp_path / "data"
    for words in (shlex.split(words) for step, words in STEPS if step == "COPY" and not words.startswith("--from")):
        for name in words[:-1]:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            source.mkdir(exist_ok=True)
            copy(ROOT / name, source / name)
    how = ["--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--no-compile"]
    subprocess.run([sys.executable, "-m", "pip", "install", *how, "--target", image, "."], cwd=source, check=True)
    told = dict(STEPS)
    (program,) = json.loads(told["ENTRYPOINT"])
    given = dict(word.partition("=")[::2] for word in shlex.split(told["ENV"]))
    environment = {**os.environ, **given, "PATH": os.environ["PATH"], "PZCTL_HOME": str(data), "PYTHONPATH": str(image)}
    own = [sys.executable, "-c", "import pzctl; print(pzctl.__file__)"]
    assert subprocess.check_output(own, env=environment, cwd=tmp_path, text=True).startswith(str(image))
    command = [sys.executable, image / "bin" / program]
    daemon = start_program([*command, *json.loads(told["CMD"])], env=environment, cwd=tmp_path)
    check = [*command, *json.loads(told["HEALTHCHECK"].partition("CMD ")[2])[1:]]
    wait_until(lambda: subprocess.run(check, env=environment, cwd=tmp_path, check=False).returncode == 0)
    daemon.terminate()
    assert daemon.wait(60) == 0
    assert subprocess.run(check, env=environment, cwd=tmp_path, check=False).returncode != 0, "nobody is healthy now"


def test_prometheus_reads_what_the_daemon_counts_with_a_token_of_its_own(
    start_daemon: Callable[..., Location], build: Build, tmp_path: Path
) -> None:
    parser = pytest.importorskip("prometheus_client.parser")
    token = add_user(tmp_path / "users.toml", "prometheus", "read")
    users = PageUsers(tmp_path / "users.toml")
    assert ask("/metrics", users=users)[0] == 401

    def scraped() -> dict[tuple[str, str], float]:
        status, headers, text = ask("/metrics", users=users, authorization=f"Bearer {token}")
        assert (status, headers["content-type"].split(";")[0]) == (200, "text/plain")
        families = parser.text_string_to_metric_families(text.decode())
        return {(one.name, one.labels.get("what", "")): one.value for family in families for one in family.samples}

    before = scraped()
    assert before.pop(("pzctl_disk_free_bytes", "")) > 1e6
    assert before == {("pzctl_up", ""): 0.0}, "no daemon runs yet, and the metric shows it"
    start_daemon()
    with connect() as lab:
        lab.measure(build, "disk")
    found = scraped()
    assert found["pzctl_up", ""] == 1.0
    assert found["pzctl_counted_total", "sweep"] == 2.0
    assert found["pzctl_measuring", ""] == 0.0


def test_every_alarm_of_the_guide_names_a_metric_that_is_told(
    start_daemon: Callable[..., Location], tmp_path: Path
) -> None:
    pytest.importorskip("prometheus_client")
    guide = (ROOT / "docs" / "service.md").read_text(encoding="utf-8")
    named = set(re.findall(r"expr: .*?(pzctl_\w+)", guide))
    assert named == {"pzctl_up", "pzctl_disk_free_bytes", "pzctl_queue", "pzctl_backup_alarm"}
    start_daemon(backup=BackupPlan(str(tmp_path / "nowhere"), 24.0))
    told = ask("/metrics")[2].decode()
    assert [name for name in named if f"\n{name}" not in told] == []


def pzctl(home: Path, *words: str) -> str:
    """Run a command on a data folder, which must succeed; return its output."""
    ran = run_here(home, *words)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def test_restore_drill_a_backup_replaces_a_data_folder_that_is_lost(
    start_daemon: Callable[..., Location],
    end: Callable[..., None],
    build: Build,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lost, restored, shelf = tmp_path / "lost", tmp_path / "restored", tmp_path / "shelf"
    monkeypatch.setenv("PZCTL_HOME", str(lost))
    where = start_daemon()
    with connect() as lab:
        measured = lab.measure(build, "disk")
        last = lab.status().seq
    pzctl(lost, "journal", "seal")
    shutil.copytree(lost / "seal", shelf)
    pzctl(lost, "journal", "backup", str(shelf / "journal"))  # while the daemon runs
    end(where.pid, signal.SIGKILL)
    shutil.rmtree(lost)

    shutil.copytree(shelf / "journal", restored / "journal")
    told = pzctl(restored, "journal", "verify", "--public-key", str(shelf / "public.pem"))
    assert "all intact" in told
    assert "sealed up to" in told, "the seals were copied and are valid"
    monkeypatch.setenv("PZCTL_HOME", str(restored))
    start_daemon()
    with connect() as lab:
        found = [event.sweep() for event in lab.sweeps(measured.id)]
        assert all(np.array_equal(a.impedance, b.impedance) for a, b in zip(found, measured.sweeps, strict=True))
        lab.measure(build, "ml1")
        assert lab.status().seq > last, "the numbering of events continues"
    pzctl(restored, "journal", "verify", "--public-key", str(shelf / "public.pem"))
