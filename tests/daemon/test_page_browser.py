"""The live page in a real Chromium: a measurement from the button to the constants, with pictures of it.

The browser is driven by its own protocol over a pipe (file descriptors 3 and 4), so no driver is needed. Set
PZCTL_SCREENSHOTS to a folder to keep the pictures.
"""

import base64
import itertools
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pzctl.daemon.client import connect
from pzctl.daemon.launch import start
from pzctl.daemon.service import Options

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None or sys.platform == "win32", reason="no chromium is installed (Debian: apt-get install chromium)"
)
PATIENCE = 30.0


class Browser:
    """One tab of a headless Chromium."""

    def __init__(self, profile: Path, width: int, height: int) -> None:
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", f"--user-data-dir={profile}"]

        def wire() -> None:  # it reads commands from descriptor 3 and writes answers to 4
            os.dup2(to_browser, 3)
            os.dup2(from_browser, 4)

        self._process = subprocess.Popen(
            [str(CHROMIUM), *words, f"--window-size={width},{height}", "about:blank"],
            preexec_fn=wire,  # noqa: PLW1509
            pass_fds=(3, 4),
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._numbers = itertools.count(1)
        self._rest = b""
        self.problems: list[str] = []
        target = next(one for one in self._send("Target.getTargets")["targetInfos"] if one["type"] == "page")
        attached = self._send("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session: str | None = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._send(f"{domain}.enable")
        self.size(width, height)

    _session: str | None = None

    def close(self) -> None:
        self._process.terminate()
        self._process.wait(20)
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
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a page beside a daemon with a simulated 4294A."""
    home = tmp_path_factory.mktemp("page")
    port = free_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(home))
        start(Options(fitters=("mason",), simulator={"time_scale": 0.01}))
        command = [Path(sys.executable).with_name("pzctl"), "page", "--port", str(port)]
        server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert server.stderr is not None
        try:
            assert f"page: http://127.0.0.1:{port}/" in server.stderr.readline()
            yield f"http://127.0.0.1:{port}/"
        finally:
            server.terminate()
            server.wait(20)
            server.stderr.close()
            with connect() as lab:
                lab.shutdown()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    named = os.environ.get("PZCTL_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("pictures")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    one = Browser(tmp_path / "profile", 1600, 1100)
    yield one
    one.close()


@needs_chromium
def test_from_the_button_to_the_constants(page: str, browser: Browser, pictures: Path) -> None:
    for _ in range(100):  # the server begins to listen just after it said where
        with socket.socket() as line:
            if not line.connect_ex(("127.0.0.1", int(page.rstrip("/").rpartition(":")[2]))):
                break
        time.sleep(0.1)
    browser.open(page)
    browser.wait("document.getElementById('daemon-light').classList.contains('on')")
    assert "4294A" in browser.run("document.getElementById('device').textContent")

    # By the keyboard alone: the first stops are the link past the header, the theme, the steps.
    browser.wait("document.getElementById('next').textContent === 'Measure disk'")
    browser.run("document.getElementById('next').focus()")
    browser.key("Enter")
    browser.wait("document.getElementById('state').textContent === 'measuring disk'")
    assert not browser.run("document.getElementById('stop').disabled")
    browser.picture(pictures / "page-measuring.png")
    browser.wait("document.getElementById('state').textContent === 'disk measured'")
    browser.wait("document.querySelectorAll('#constants tbody tr').length >= 5")
    stiffness = browser.run("document.querySelector('#constants tbody td:nth-child(2)').textContent")
    assert re.fullmatch(r"1\.5\d*\(\d+\)e11 \+ 1\.6\d*\(\d+\)e9 j", stiffness)
    assert browser.run("document.getElementById('chi2').className") == "big good"
    assert browser.run("document.getElementById('plot-z').dataset.points") == "801"
    assert browser.run("document.querySelectorAll('#segments button').length") == 2
    browser.wait("document.querySelectorAll('#samples li').length === 1")
    browser.wait("document.getElementById('next').textContent === 'Measure ml1'")
    for theme in ("dark", "light"):
        while browser.run("document.documentElement.dataset.theme") != theme:
            browser.run("document.getElementById('theme').click()")
        assert browser.picture(pictures / f"page-{theme}.png") > 50_000
    browser.size(820, 1180)
    browser.wait("document.documentElement.scrollWidth <= 820")
    browser.wait("document.querySelector('#plot-z canvas').clientWidth > 600")  # drawn anew for this width
    browser.picture(pictures / "page-tablet.png")
    assert browser.problems == []


@needs_chromium
def test_by_hand_the_curve_moves_before_a_fit_and_the_diagnosis_comes_in_words(
    page: str, browser: Browser, pictures: Path
) -> None:
    browser.open(page)
    browser.wait("document.getElementById('constants').tBodies[0].rows.length >= 5")
    browser.run("document.getElementById('hand-open').click()")
    browser.wait("document.querySelectorAll('#hand-handles .handle').length >= 10")
    at_rest = "!document.getElementById('hand').dataset.busy"
    misfit = "Number(document.getElementById('hand-chi2').textContent.split(' ')[1])"
    browser.wait(at_rest)
    assert browser.run(misfit) < 1.5, "it begins where the fit ended"
    browser.run("document.querySelector('[data-handle=\"disk.c33D\"]').focus()")
    for _ in range(30):
        browser.key("ArrowRight")
    browser.wait(f"{at_rest} && {misfit} > 100")
    assert browser.run("document.getElementById('chi2').className") == "big good", "nothing was fitted yet"
    browser.run("document.getElementById('hand-bands').value = '1-6'")
    browser.run("document.getElementById('hand-none').click()")
    for name in ("disk.c33D", "disk.h33.loss"):  # which is bounded by the loss of the other two
        browser.run(f"document.querySelector('[aria-label=\"free {name}\"]').click()")
    browser.run("document.getElementById('hand-fit').scrollIntoView()")
    browser.picture(pictures / "page-by-hand.png")
    browser.run("document.getElementById('hand-fit').click()")
    browser.wait(f"{at_rest} && {misfit} < 1.5")
    assert browser.run("document.getElementById('fitter').textContent").startswith("by by-hand")
    assert browser.run("document.querySelectorAll('#constants tbody tr:not(.held)').length") == 1, "only c33D was free"
    assert browser.problems == []


@needs_chromium
def test_what_was_left_out_is_found_named_and_marked(page: str, browser: Browser, pictures: Path) -> None:
    with connect() as lab:
        lab.bench({"command": "hidden", "lead-inductance": 1e-8})
        browser.open(page)
        browser.wait(
            "[...document.querySelectorAll('#steps button')].some((b) => b.textContent === 'disk' && !b.disabled)"
        )
        browser.run("[...document.querySelectorAll('#steps button')].find((b) => b.textContent === 'disk').click()")
        browser.wait("document.getElementById('chi2').classList.contains('bad')")
        lab.bench({"command": "hidden", "lead-inductance": 0.0})

    # By hand: the effect that one suspects is added, and its slider shows what it does.
    browser.run("document.getElementById('hand-open').click()")
    browser.wait("document.querySelectorAll('#hand-handles .handle').length >= 10")
    browser.run("document.getElementById('hand-effect').value = '[\"lead-inductance\",\"terminals\"]'")
    browser.run("document.getElementById('hand-add').click()")
    browser.wait("document.querySelector('[data-handle=\"lead-inductance@terminals.inductance\"]') !== null")
    browser.wait("!document.getElementById('hand').dataset.busy")
    browser.run("document.getElementById('hand-fit').click()")
    browser.wait("document.getElementById('chi2').classList.contains('good')")
    shown = "document.querySelector('[data-handle=\"lead-inductance@terminals.inductance\"]').nextSibling.textContent"
    assert float(browser.run(shown).split()[0]) == pytest.approx(1e-8, rel=0.05)

    # The diagnosis finds it without being told.
    browser.run("document.getElementById('diagnose').click()")
    browser.wait("document.querySelectorAll('#stack .guilty').length === 1")
    assert "lead-inductance: terminals" in browser.run("document.getElementById('stack').textContent")
    assert "left out" in browser.run("document.getElementById('words').textContent")
    browser.run("window.scrollTo(0, 0)")
    browser.picture(pictures / "page-diagnosed.png")
    assert browser.problems == []


@needs_chromium
def test_stop_and_what_the_daemon_refuses(page: str, browser: Browser) -> None:
    browser.open(page)
    browser.wait("document.getElementById('daemon-light').classList.contains('on')")
    browser.wait("[...document.querySelectorAll('#steps button')].some((b) => b.textContent === 'ml1' && !b.disabled)")
    browser.run("[...document.querySelectorAll('#steps button')].find((b) => b.textContent === 'ml1').click()")
    browser.wait("!document.getElementById('stop').disabled")
    browser.run("document.getElementById('stop').click()")
    browser.wait("document.getElementById('state').textContent === 'ml1 cancelled'")
    browser.wait("![...document.querySelectorAll('#steps button')][0].disabled")
    browser.run("[...document.querySelectorAll('#steps button')].find((b) => b.textContent === 'disk').click()")
    browser.wait("document.getElementById('problem').textContent.includes('glue does not come off')")
