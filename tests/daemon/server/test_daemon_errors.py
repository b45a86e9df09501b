"""Error sentences of a daemon that cannot do a request, and of clients whose daemon is missing or hangs."""

import asyncio
import os
import signal
from collections.abc import Callable
from contextlib import aclosing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from pzctl import connect, connect_async
from pzctl.daemon.cli.commands import app
from pzctl.daemon.client import event_follower
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.server.launch import start
from pzctl.daemon.server.requests.request_handlers import MOST_FITTERS
from pzctl.daemon.server.requests.submissions import MOST_ANSWERS
from pzctl.daemon.server.workers.job_runner import MOST as MOST_ERRANDS
from pzctl.daemon.wire import requests as ask
from pzctl.daemon.wire.replies import Answer
from pzctl.daemon.wire.uuid7 import uuid7
from pzctl.models.base.errors import PzctlError
from pzctl.models.build import Build


def submitted(lab: Client, measurement: str, sweeps: tuple[str, ...], **answer: Any) -> object:
    said: dict[str, Any] = {"version": "1", **answer}
    request = ask.SubmitRequest(id=uuid7(), measurement=measurement, sweeps=sweeps, fitter="mine", **said)
    return lab.run(lab.conversations.answer_to(request, Answer))


def sentence(work: Callable[[], object]) -> str:
    with pytest.raises(PzctlError) as caught:
        work()
    return str(caught.value)


def test_what_a_daemon_cannot_do(as_for_users, start_daemon, build: Build, tmp_path: Path) -> None:
    where = start_daemon()
    host, port = where.resource.split("::")[1:3]
    assert start(DaemonOptions(resource=f"{host}:{port}")) == where, "the same instrument by its short name"
    with connect() as lab:
        one = lab.measure(build, "disk")
        sweeps = tuple(sweep.id for sweep in one.sweeps)
        assert build.plan is not None
        with pytest.raises(DaemonError, match="bandwidth is 9; the 4294A can do 1 to 5"):
            lab.begin(build, "disk", replace(build.plan, bandwidth=9))
        cancelled = [lab.begin(build, "disk") for _ in range(20)][-1]
        lab.cancel(cancelled)
        lab.measure(build, "disk")  # behind it in the queue
        for work, says in (
            (
                lambda: lab.begin(replace(build, plan=None), "disk"),
                "neither the request nor build 'S4.a' has a sweep plan; give a plan, or a [sweep] table in build.toml",
            ),
            (lab.cancel, "nothing is being measured"),
            (lambda: lab.fit(cancelled, "bvd"), f"measurement {cancelled!r} is cancelled; it has no complete sweeps"),
            (
                lambda: lab.bench({"command": "step", "name": "ml7"}),
                "bench: no gluing step 'ml7'; there are disk, ml1, ml2",
            ),
            (
                lambda: submitted(lab, one.id, ("x",), error="no"),
                "answer of 'mine': the journal holds no sweep 'x'",
            ),
            (
                lambda: submitted(lab, one.id, sweeps, error="no", diagnosis={}),
                "answer of 'mine' holds error and diagnosis; exactly one of report, error, diagnosis is needed",
            ),
            (
                lambda: [submitted(lab, one.id, sweeps, error="no", version=str(k)) for k in range(MOST_ANSWERS + 1)],
                f"fitter 'mine' answered this measurement {MOST_ANSWERS} times already",
            ),
            (
                lambda: [lab.hello(f"fitter{k}", "1") for k in range(MOST_FITTERS + 1)],
                f"{MOST_FITTERS} fitters are connected already",
            ),
            (
                lambda: start(DaemonOptions(resource="127.0.0.1:5025")),
                f"a daemon runs already (process {where.pid}) and measures with {where.resource}, not 127.0.0.1:5025; "
                "end it first",
            ),
            (
                lambda: raised(["screenshot", str(tmp_path / "s.tif"), "--resource", str(where.resource)]),
                f"the running daemon owns {where.resource}; end it with `pzctl daemon --stop`",
            ),
            (
                lambda: raised(["measure", "--step", "disk", "--resource", "127.0.0.1:5025"]),
                f"the running daemon owns {where.resource}, not 127.0.0.1:5025; end it with `pzctl daemon --stop`",
            ),
            (
                lambda: [diagnosed(lab, one.id, k) for k in range(3 * MOST_ERRANDS)],
                f"{MOST_ERRANDS} fits and diagnoses run or wait already",
            ),
        ):
            assert sentence(work) == says


def raised(words: list[str]) -> None:
    done = CliRunner().invoke(app, words)
    assert done.exception is not None
    raise done.exception


def diagnosed(lab: Client, measurement: str, k: int) -> object:
    """Request one of a hundred diagnoses that differ in their effects."""
    effects = (("leakage",), ("cable",), ("lead-inductance",))[k % 3]
    wish = ask.DiagnoseRequest(
        id=uuid7(), measurement=measurement, effects=effects, also=(measurement,) * (k // 6), propose=bool(k // 3 % 2)
    )
    return lab.run(lab.conversations.answer_to(wish, Answer, patience=60.0))


def test_a_daemon_that_hangs_and_one_that_is_not_there(
    start_daemon, monkeypatch: pytest.MonkeyPatch, build: Build
) -> None:
    where = start_daemon()
    monkeypatch.setattr(event_follower, "SILENCE", 0.3)

    async def heard() -> None:
        async with connect_async() as lab, aclosing(await lab.listen()) as events:
            waiting = asyncio.ensure_future(anext(events))
            await asyncio.sleep(1.5)
            os.kill(where.pid, signal.SIGSTOP)
            await waiting

    with connect() as lab:
        events = lab.listen(10.0)
        os.kill(where.pid, signal.SIGSTOP)
        try:
            says = f"daemon at {where.events}: silent for 0.3 s; it has ended or hangs"
            assert sentence(lambda: next(events)) == says
        finally:
            os.kill(where.pid, signal.SIGCONT)
    try:
        assert sentence(lambda: asyncio.run(heard())).startswith(f"daemon at {where.events}: silent for 0.3 s")
    finally:
        os.kill(where.pid, signal.SIGCONT)
