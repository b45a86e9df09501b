"""`pzctl page`: its address, and the daemon that it starts."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from pzctl.daemon.cli.bench.page_command import page
from pzctl.daemon.client.client import connect
from pzctl.daemon.page import page_process
from pzctl.daemon.server import launch
from pzctl.daemon.server.launch import running

PZCTL = Path(sys.executable).with_name("pzctl")


def test_the_address_holds_a_token_of_any_characters(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    served: list[str] = []
    monkeypatch.setattr(page_process, "serve", lambda build, listener, token, **_: served.append(token))
    monkeypatch.setattr(launch, "running", lambda: "a daemon")
    token = "100 % of it & more #1 + ä/?"  # noqa: S105
    page(port=0, token=token, as_json=True)
    address = json.loads(capsys.readouterr().out)["page"]
    assert parse_qs(urlsplit(address).query) == {"token": served} == {"token": [token]}


@pytest.mark.system
@pytest.mark.skipif(sys.platform == "win32", reason="ended with SIGINT, as by Ctrl-C in a terminal")
def test_the_daemon_outlives_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    words = [PZCTL, "page", "--port", "0"]
    with subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PZCTL_HOME": str(tmp_path)},
    ) as page:
        assert page.stdout
        assert page.stderr
        assert page.stdout.readline().startswith("page: http://127.0.0.1:")
        page.send_signal(signal.SIGINT)
        said = page.stderr.read()
        page.wait(60)
    assert "it keeps running" in said
    place = running()
    assert place is not None
    with connect(place.events, place.requests) as lab:
        assert [one.instrument.simulated for one in lab.hello().analyzers] == [True]
        lab.shutdown()
