"""Measurements of the live page: time from the end of a sweep to its picture, and the page's effect on acquisition.

Run with `make bench`, or this file with `pytest -s`.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from chromium import Browser, live_page, needs_chromium

from pzctl.daemon.client.client import Client, connect
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

BUILD = THESIS_BUILD
ROUNDS = 9


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with closing(Browser(tmp_path / "profile")) as one, one.tab(1600, 1100):
        yield one


def seconds(lab: Client, build: Build, plan: SweepPlan) -> float:
    began = time.perf_counter()
    lab.measure(build, "disk", plan)
    return time.perf_counter() - began


@needs_chromium
def test_from_the_end_of_a_sweep_to_its_picture(tmp_path: Path, browser: Browser) -> None:
    build = read_build(BUILD)
    with live_page(tmp_path / "home", 0.0) as address, connect() as lab:
        browser.open(address)
        browser.wait("document.getElementById('daemon-light').classList.contains('on')")
        for points in (801, 10_000 // 801 * 801):
            segments = tuple(Segment(1e6 + k * 1e6, 2e6 + k * 1e6, 801) for k in range(points // 801))
            lags: list[float] = []
            for _ in range(ROUNDS):
                browser.run("delete document.body.dataset.lag")
                lab.measure(build, "disk", SweepPlan(segments))
                browser.wait("document.body.dataset.lag !== undefined")
                lags.append(float(browser.run("document.body.dataset.lag")))
            print(
                f"\n{points} points: from announced to painted, median {np.median(lags):.0f} ms, worst {max(lags):.0f}"
            )


@needs_chromium
def test_an_open_page_does_not_slow_acquisition(tmp_path: Path, browser: Browser) -> None:
    """In turns with and without an open page that draws every sweep, with a simulated 4294A that answers at once."""
    build = read_build(BUILD)
    plan = SweepPlan((Segment(1e6, 6e6, 801),))
    taken: dict[str, list[float]] = {"about:blank": [], "page": []}
    with live_page(tmp_path / "home", 0.0) as address, connect() as lab:
        seconds(lab, build, plan)
        for _ in range(ROUNDS):
            for name, found in taken.items():
                browser.open(address if name == "page" else name)
                if name == "page":
                    browser.wait("document.getElementById('daemon-light').classList.contains('on')")
                time.sleep(1)  # loading the page is not part of the cost
                found += [seconds(lab, build, plan) for _ in range(ROUNDS)]
    without, with_page = (float(np.median(found)) for found in taken.values())
    print(f"\na sweep with the page open: {1e3 * with_page:.0f} ms, without: {1e3 * without:.0f} ms; ", end="")
    print(f"{with_page / without:.2f} times, medians of {len(taken['page'])}")


@needs_chromium
def test_sliders_do_not_slow_acquisition(tmp_path: Path, browser: Browser) -> None:
    build = read_build(BUILD)
    plan = SweepPlan((Segment(1e6, 6e6, 801),))
    with live_page(tmp_path / "home") as address, connect() as lab:
        lab.measure(build, "disk")
        browser.open(address)
        browser.wait("document.getElementById('constants').tBodies[0].rows.length >= 5")
        browser.run("document.getElementById('hand-open').click()")
        browser.wait("document.querySelectorAll('#hand-handles .handle').length >= 10")
        drag = "const s = document.querySelector('[data-handle=\"disk.c33D\"]'); s.value = 400 + 200 * Math.random();"
        stop, moves = threading.Event(), [0]

        def dragging() -> None:
            while not stop.is_set():
                browser.run(f"(() => {{ {drag} s.dispatchEvent(new Event('input')); }})()")
                moves[0] += 1

        alone = [seconds(lab, build, plan) for _ in range(ROUNDS)]
        # the measurements are now the newest on the page: fit the last one by hand
        browser.run("document.getElementById('hand-open').click()")
        browser.wait("document.querySelectorAll('#hand-handles .handle').length >= 10")
        hand = threading.Thread(target=dragging)
        hand.start()
        dragged = [seconds(lab, build, plan) for _ in range(ROUNDS)]
        stop.set()
        hand.join()
    ratio = float(np.median(dragged) / np.median(alone))
    print(f"\na sweep with somebody dragging a slider ({moves[0]} moves) takes {ratio:.2f} times as long as without")
