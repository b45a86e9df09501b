"""Endless connection attempts do not fill the disk: the log counts them and rotates its files."""

import asyncio
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import zmq

from pzctl import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.worker_limits import Limits
from pzctl.daemon.journal.journal_reader import JournalMeasurement
from pzctl.daemon.server.logs import LOGS_KEPT, MINUTE, REPEATED, RepeatLimit
from pzctl.daemon.server.workers.bounded_logs import keep_newest
from pzctl.daemon.server.workers.job_runner import JobRunner, WorkerJob
from pzctl.daemon.server.workers.process_runner import ProcessExit
from pzctl.daemon.server.workers.subprocesses import last_line
from pzctl.daemon.wire.curve_keys import ClientKey, new_pair
from pzctl.daemon.wire.events import FitEvent, SampleStep
from pzctl.daemon.wire.socket_options import unlock


class Kept(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


@pytest.fixture
def log() -> tuple[logging.Logger, list[str], list[Callable[[], None]]]:
    """Return a logger, its lines, and its callbacks for the end of a minute."""
    kept, due = Kept(), []

    def later(seconds: float, do: Callable[[], None]) -> None:
        assert seconds == MINUTE
        due.append(do)

    logger = logging.Logger("refusals")
    logger.addHandler(RepeatLimit(kept, later))
    return logger, kept.lines, due


def test_repeated_refusals_become_one_line_a_minute(log) -> None:
    logger, lines, due = log
    for k in range(REPEATED + 1234):
        logger.warning("turned away: %s", k)
    logger.warning("another kind")
    logger.info("measured")
    assert lines == [*(f"turned away: {k}" for k in range(REPEATED)), "another kind", "measured"]
    for minute_is_over in due:
        minute_is_over()
    assert lines[-1] == "... and 1234 more in the last minute like: turned away: 0"
    logger.warning("turned away: %s", "again")
    assert lines[-1] == "turned away: again"


def test_unknown_keys_leave_few_lines(start_daemon: Callable[..., Location], tmp_path: Path) -> None:
    where = start_daemon()
    for _ in range(3 * REPEATED):
        pair = new_pair()
        with zmq.Context() as context, context.socket(zmq.DEALER) as link:
            link.linger = 0
            unlock(link, ClientKey(where.key.server, pair.public, pair.secret))
            heard = link.get_monitor_socket()
            link.connect(where.requests)
            while heard.poll(20_000) and not _is_refused(heard):
                pass
            link.disable_monitor()
            heard.close()
    with connect() as lab:
        assert lab.status().seq > 0
    assert Path(where.log).read_text().count("an unknown or expired key was refused") == REPEATED


def test_a_long_command_of_the_bench_is_refused_and_no_other_fills_the_log(
    start_daemon: Callable[..., Location], tmp_path: Path
) -> None:
    start_daemon()
    with connect() as lab:
        for command, says in (
            ({"command": "x" * 60_000}, "a command of 60014 bytes; at most 4096 are allowed"),
            ({"command": "y" * 4000}, "bench: no command"),
            ({"command": "power-cycle", "seconds": ["a"]}, "'seconds' is .'a'.; a number is needed"),
        ):
            with pytest.raises(DaemonError, match=says):
                lab.bench(command)
        assert lab.bench({"command": "status"})["ok"]
    assert sum(path.stat().st_size for path in (tmp_path / "log").iterdir()) < 8000


def test_the_logs_of_failed_jobs_are_few_and_short(tmp_path: Path) -> None:
    for k in range(30):
        path = tmp_path / f"job-{k}.log"
        path.write_bytes(b"x" * 5000 + f"why {k}".encode())
        os.utime(path, (k, k))
    (tmp_path / "daemon.log").write_bytes(b"x" * 5000)
    keep_newest(tmp_path, "job-*.log*", 20, 1000)
    kept = sorted(tmp_path.glob("job-*"), key=lambda path: path.stat().st_size)
    assert {path.stem for path in kept} == {f"job-{k}" for k in range(10, 30)}
    assert all(path.stat().st_size == 1000 for path in kept)
    assert (tmp_path / "job-29.log").read_bytes().endswith(b"why 29")
    assert (tmp_path / "daemon.log").stat().st_size == 5000


def test_two_jobs_of_one_measurement_have_separate_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finished job removes its log; the other one fails later and must find its own log to report."""
    done = asyncio.Event()

    async def run(module: str, arguments: list[str], log: Path, *_: object) -> ProcessExit:
        log.write_text(f"the end of {arguments[2]}")
        if "bvd" in arguments:
            await done.wait()
            return ProcessExit(1, last_line(log))
        asyncio.get_running_loop().call_later(0.05, done.set)
        return ProcessExit(0, "")

    monkeypatch.setattr("pzctl.daemon.server.workers.job_runner.run_to_end", run)
    answers: list[FitEvent] = []

    async def both() -> None:
        jobs = JobRunner(tmp_path, "events", "requests", None, Limits(), answers.append)
        of = JournalMeasurement("m", "run", SampleStep("S4", "disk"), "measured", "")
        assert jobs.begin(WorkerJob("m", "bvd"), of, ())
        assert jobs.begin(WorkerJob("m", "mason"), of, ())
        await asyncio.wait_for(asyncio.gather(*jobs.running.values()), 10)

    asyncio.run(both())
    assert [answer.error for answer in answers] == ["bvd of measurement m: the end of bvd"]


def _is_refused(heard: "zmq.Socket[bytes]") -> bool:
    event = int.from_bytes(heard.recv_multipart()[0][:2], sys.byteorder)
    return event in (zmq.EVENT_HANDSHAKE_FAILED_AUTH, zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL, zmq.EVENT_DISCONNECTED)


def test_the_background_log_is_bounded(tmp_path: Path) -> None:
    """When a file is full, log lines and a library's standard error continue in the new file."""
    program = (
        "import logging, os, sys; from pathlib import Path; from pzctl.daemon.server import logs\n"
        "logs.LARGEST_LOG = 1000; logs.begin_log(file=Path(sys.argv[1]))\n"
        "for k in range(200): logging.info('line %s', k)\n"
        "os.write(2, b'the last word\\n')"
    )
    log = tmp_path / "daemon.log"
    subprocess.run([sys.executable, "-c", program, log], check=True, timeout=60, env=dict(os.environ))
    files = sorted(tmp_path.iterdir())
    assert len(files) == 1 + LOGS_KEPT
    assert all(file.stat().st_size < 1100 for file in files)
    assert log.read_text().splitlines()[-1] == "the last word"
    assert "line 199" in log.read_text()
