"""A headless Chromium and a live page for tests and benchmarks.

The browser is driven by its own protocol over a pipe (file descriptors 3 and 4), so no driver is needed.
"""

import base64
import itertools
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.server.launch import start

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None or sys.platform == "win32", reason="no chromium is installed (Debian: apt-get install chromium)"
)
PATIENCE = 150.0


class Browser:
    """A headless Chromium, and the tab of it that is driven."""

    def __init__(self, profile: Path) -> None:
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", f"--user-data-dir={profile}"]
        words.append("--force-prefers-reduced-motion")  # or it draws what turns, all the time that a test waits

        def wire() -> None:  # it reads commands from descriptor 3 and writes answers to 4
            os.dup2(to_browser, 3)
            os.dup2(from_browser, 4)

        self._process = subprocess.Popen(
            [str(CHROMIUM), *words, "about:blank"],
            preexec_fn=wire,  # noqa: PLW1509
            pass_fds=(3, 4),
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._numbers = itertools.count(1)
        self._rest = b""
        self.problems: list[str] = []
        self._session: str | None = None

    @contextmanager
    def tab(self, width: int, height: int) -> Iterator[None]:
        """Drive a new tab that shares nothing with earlier ones, as in a new profile; close it afterwards."""
        self.problems.clear()
        context = self._send("Target.createBrowserContext")["browserContextId"]
        size = {"width": width, "height": height}
        target = self._send("Target.createTarget", url="about:blank", browserContextId=context, **size)["targetId"]
        attached = self._send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._send(f"{domain}.enable")
        self.size(**size)
        yield
        self._session = None
        self._send("Target.disposeBrowserContext", browserContextId=context)

    def close(self) -> None:
        self._process.terminate()
        self._process.wait(60)
        os.close(self._out)
        os.close(self._in)

    def size(self, width: int, height: int) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._send("Emulation.setDeviceMetricsOverride", **metrics)

    def open(self, address: str) -> None:
        self._send("Page.navigate", url=address)

    def run(self, script: str) -> Any:
        answer = self._send("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        return answer["result"].get("value")

    def wait(self, script: str) -> Any:
        """Return the script's value as soon as it is true."""
        deadline = time.monotonic() + PATIENCE
        while not (found := self.run(script)):
            assert time.monotonic() < deadline, f"{script} did not become true; {self.run('document.body.innerText')}"
            time.sleep(0.1)
        return found

    def key(self, name: str) -> None:
        code = {"Tab": 9, "Enter": 13, "ArrowRight": 39}[name]
        text = {"text": "\r"} if name == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self._send("Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=code, **text)

    def type(self, text: str) -> None:
        self._send("Input.insertText", text=text)

    def picture(self, path: Path) -> int:
        """Take a picture of the whole page; return its size in bytes."""
        shot = self._send("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))
        return path.stat().st_size

    def _send(self, method: str, **words: Any) -> dict[str, Any]:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": words}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                self._rest += os.read(self._in, 1 << 20)
            text, self._rest = self._rest.split(b"\0", 1)
            heard = json.loads(text)
            if heard.get("method") == "Runtime.exceptionThrown":
                self.problems.append(json.dumps(heard["params"]["exceptionDetails"])[:500])
            if heard.get("method") == "Log.entryAdded" and heard["params"]["entry"]["level"] == "error":
                self.problems.append(heard["params"]["entry"]["text"] + " " + heard["params"]["entry"].get("url", ""))
            if heard.get("id") == number:
                assert "error" not in heard, f"{method}: {heard['error']}"
                return heard["result"]


def free_port() -> int:
    """Return a free port outside the system's ephemeral range, so that it stays free."""
    while True:
        with socket.socket() as one, suppress(OSError):
            one.bind(("127.0.0.1", random.randrange(10_000, 32_768)))  # noqa: S311
            return int(one.getsockname()[1])


@contextmanager
def live_page(home: Path, time_scale: float = 0.01, build: Path | None = None) -> Iterator[str]:
    """Give the address of a page of a daemon with a simulated 4294A, on its own data folder.

    Its build is that of the thesis unless another is given.

    Automatic diagnoses are off: they would delay the work that a test waits for.
    """
    port = free_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(home))
        start(DaemonOptions(fitters=("mason",), simulator={"time_scale": time_scale}, diagnose="asked"))
        command = [Path(sys.executable).with_name("pzctl"), "page", "--port", str(port)]
        command += [] if build is None else ["--build", build]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None
        try:
            assert f"page: http://127.0.0.1:{port}/" in server.stdout.readline()
            while not _listens(port):  # just after it printed its address
                time.sleep(0.1)
            yield f"http://127.0.0.1:{port}/"
        finally:
            server.terminate()
            server.wait(60)
            server.stdout.close()
            with connect() as lab:
                lab.shutdown()


def _listens(port: int) -> bool:
    with socket.socket() as line:
        return line.connect_ex(("127.0.0.1", port)) == 0
