"""The live page in a real Chromium: a measurement from the button to the constants, with pictures of it.

Set PZCTL_SCREENSHOTS to a folder to keep the pictures.
"""

import os
import re
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from chromium import Browser, live_page, needs_chromium

from pzctl.daemon.client.client import Client, connect
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.models.sweep_plan import Segment, SweepPlan


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build of the thesis with one band and fewer points, unless pictures are wanted."""
    if "PZCTL_SCREENSHOTS" in os.environ:
        return THESIS_BUILD
    text = THESIS_BUILD.read_text(encoding="utf-8")
    path = tmp_path_factory.mktemp("build") / "build.toml"
    (wider,) = re.findall(r"\n +\{ start_MHz = 0\.5.*", text)
    path.write_text(text.replace(wider, "").replace("points = 801", "points = 41"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, build: Path) -> Iterator[str]:
    with live_page(tmp_path_factory.mktemp("page"), build=build) as address:
        yield address


@pytest.fixture
def fresh(tmp_path: Path) -> Iterator[str]:
    """A page of a daemon without measurements."""
    with live_page(tmp_path) as address:
        yield address


@pytest.fixture(scope="module")
def pictures() -> Path | None:
    """The folder of pictures, if they are wanted."""
    named = os.environ.get("PZCTL_SCREENSHOTS")
    if not named:
        return None
    folder = Path(named)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with closing(Browser(tmp_path_factory.mktemp("profile"))) as one:
        yield one


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    with chromium.tab(1600, 1100):
        yield chromium


@pytest.fixture
def lab(page: str) -> Iterator[Client]:
    """The daemon behind the page, with a bare transducer, so that the tests do not depend on each other."""
    with connect() as made:
        made.bench({"command": "new-sample", "seed": 3})
        yield made


def press(browser: Browser, which: str, begins: str) -> None:
    """Press the button whose text begins like this, as soon as it is enabled."""
    found = f"[...document.querySelectorAll('{which} button')].find((b) => b.textContent.startsWith('{begins}'))"
    browser.wait(f"{found} !== undefined && !{found}.disabled")
    browser.run(f"{found}.click()")


def keep_picture(browser: Browser, pictures: Path | None, name: str) -> None:
    """Take a picture of the page if pictures are wanted: a second of processor time."""
    if pictures is not None:
        browser.picture(pictures / name)


@needs_chromium
def test_from_the_button_to_the_constants(fresh: str, browser: Browser, pictures: Path | None, tmp_path: Path) -> None:
    browser.open(fresh)
    browser.wait("document.getElementById('daemon-light').classList.contains('on')")
    assert "4294A" in browser.run("document.getElementById('device').textContent")

    # By keyboard only: the first tab stops are the link past the header, the theme, the steps.
    browser.wait("document.getElementById('next').textContent === 'Measure disk'")
    browser.run("document.getElementById('next').focus()")
    browser.key("Enter")
    browser.wait("document.getElementById('state').textContent === 'measuring disk'")
    assert not browser.run("document.getElementById('stop').disabled")
    keep_picture(browser, pictures, "page-measuring.png")
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
        assert browser.picture((pictures or tmp_path) / f"page-{theme}.png") > 50_000
    browser.size(820, 1180)
    browser.wait("document.documentElement.scrollWidth <= 820")
    browser.wait("document.querySelector('#plot-z canvas').clientWidth < 420")  # drawn anew for this width
    keep_picture(browser, pictures, "page-tablet.png")
    assert browser.problems == []


@needs_chromium
def test_by_hand_the_curve_moves_before_a_fit_and_the_diagnosis_comes_in_words(
    page: str, build: Path, lab: Client, browser: Browser, pictures: Path | None
) -> None:
    lab.wait_fit("mason", lab.measure(read_build(build), "disk").id)
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
    for name in ("disk.c33D", "disk.h33.loss"):  # it is bounded by the loss of the other two
        browser.run(f"document.querySelector('[aria-label=\"free {name}\"]').click()")
    browser.run("document.getElementById('hand-fit').scrollIntoView()")
    keep_picture(browser, pictures, "page-by-hand.png")
    browser.run("document.getElementById('hand-fit').click()")
    browser.wait(f"{at_rest} && {misfit} < 1.5")
    assert browser.run("document.getElementById('fitter').textContent").startswith("fitter by-hand")
    assert browser.run("document.querySelectorAll('#constants tbody tr:not(.held)').length") == 1, "only c33D was free"

    # A kept fit is in the journal with its author's name, and listed with the others.
    assert browser.run("document.getElementById('hand-keep-it').disabled"), "no name was entered"
    browser.run("document.getElementById('hand-by').focus()")
    browser.type("Ana")
    browser.key("Enter")
    browser.wait("document.getElementById('hand-kept').textContent === 'kept by Ana'")
    browser.wait("document.querySelectorAll('#fits button').length === 2")
    assert browser.run("[...document.querySelectorAll('#fits button')].at(-1).textContent") == "by-hand · Ana"
    assert browser.problems == []


@needs_chromium
def test_a_missing_effect_is_found_named_and_marked(
    page: str, lab: Client, browser: Browser, pictures: Path | None
) -> None:
    lab.bench({"command": "hidden", "lead-inductance": 1e-8})
    browser.open(page)
    press(browser, "#steps", "disk")
    browser.wait("document.getElementById('chi2').classList.contains('bad')")
    lab.bench({"command": "hidden", "lead-inductance": 0.0})

    # By hand: the suspected effect is added, and its slider shows how the curve changes.
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

    # The diagnosis finds it by itself.
    browser.run("document.getElementById('diagnose').click()")
    browser.wait("document.getElementById('diagnosing').checkVisibility()")
    assert browser.run("document.getElementById('diagnosing').textContent").startswith("Diagnosing")
    browser.wait("document.querySelectorAll('#stack .marked').length === 1")
    assert not browser.run("document.getElementById('diagnosing').checkVisibility()")
    assert not browser.run("document.getElementById('diagnose').disabled")
    assert "lead-inductance: terminals" in browser.run("document.getElementById('stack').textContent")
    assert "explain the whole difference" in browser.run("document.getElementById('words').textContent")
    browser.run("window.scrollTo(0, 0)")
    keep_picture(browser, pictures, "page-diagnosed.png")
    assert browser.problems == []


@needs_chromium
def test_a_bare_disk_is_fitted_by_hand_with_the_model_of_both_modes(
    page: str, lab: Client, browser: Browser, pictures: Path | None
) -> None:
    lab.bench({"command": "effects", "radial": True})
    plan = SweepPlan((Segment(80e3, 600e3, 401), Segment(2e6, 9e6, 401)))
    lab.wait_fit("mason", lab.measure(replace(read_build(THESIS_BUILD), name="round", plan=plan), "disk").id)
    lab.bench({"command": "effects", "radial": False})
    browser.open(page)
    press(browser, "#samples", "round · disk")
    browser.wait("document.getElementById('sample').textContent === 'round'")  # not the page's default
    assert browser.run("document.getElementById('chi2').className") == "big bad", "mason knows no radial modes"
    browser.run("document.getElementById('hand-open').click()")
    at_rest = "!document.getElementById('hand').dataset.busy"
    browser.wait(f"document.querySelectorAll('#hand-handles .handle').length >= 10 && {at_rest}")
    models = "[...document.getElementById('hand-model').options].map((one) => one.value).join()"
    assert browser.run(models) == "mason,radial,disk"
    browser.run(
        "const one = document.getElementById('hand-model'); one.value = 'disk'; one.dispatchEvent(new Event('change'))"
    )
    slider = "document.querySelector('[data-handle=\"disk.s11E\"]')"
    browser.wait(f"{slider} !== null && {at_rest}")
    misfit = "Number(document.getElementById('hand-chi2').textContent.split(' ')[1])"
    browser.run("document.getElementById('hand-fit').click()")
    browser.wait(f"{at_rest} && {misfit} < 1.5")
    browser.run(f"{slider}.focus()")
    for _ in range(30):
        browser.key("ArrowRight")
    browser.wait(f"{at_rest} && {misfit} > 100")
    keep_picture(browser, pictures, "page-by-hand-disk.png")
    before = browser.run("document.querySelector('[data-handle=\"disk.s12E\"]').value")
    browser.run("document.getElementById('hand-none').click()")
    browser.run("document.querySelector('[aria-label=\"free disk.s11E\"]').click()")
    browser.run("document.getElementById('hand-fit').click()")
    browser.wait(f"{at_rest} && {misfit} < 1.5")
    assert browser.run("document.querySelector('[data-handle=\"disk.s12E\"]').value") == before, "it was held"
    browser.run("document.getElementById('hand-by').focus()")
    browser.type("Ana")
    browser.key("Enter")
    browser.wait("document.getElementById('hand-kept').textContent === 'kept by Ana'")
    browser.wait("[...document.querySelectorAll('#fits button')].at(-1)?.textContent === 'by-hand (disk) · Ana'")
    assert "on the model of disk" in browser.run("document.getElementById('words').textContent")
    assert browser.problems == []


@pytest.fixture
def slow(tmp_path: Path) -> Iterator[str]:
    """A page whose analyzer takes as long as a real one: minutes for a sweep."""
    with live_page(tmp_path, time_scale=1.0) as address:
        yield address


@needs_chromium
def test_stop_and_refusals_of_the_daemon(slow: str, browser: Browser) -> None:
    browser.open(slow)
    browser.wait("document.getElementById('daemon-light').classList.contains('on')")
    press(browser, "#steps", "ml1")
    browser.run(STOP)
    browser.wait("document.getElementById('state').textContent === 'ml1 cancelled'")
    press(browser, "#steps", "disk")
    browser.wait("document.getElementById('problem').textContent.includes('glue does not come off')")


@needs_chromium
def test_an_overlaid_sample_the_pdf_report_and_keyboard_operation(
    page: str, build: Path, lab: Client, browser: Browser, pictures: Path | None
) -> None:
    plan = SweepPlan((Segment(1e6, 6e6, 101), Segment(5e5, 15.5e6, 101)))
    for name, seed in (("older", 7), ("newer", 8)):
        lab.bench({"command": "new-sample", "seed": seed})
        lab.wait_fit("mason", lab.measure(replace(read_build(build), name=name, plan=plan), "disk").id)
    browser.open(page)
    choose = "[...document.querySelectorAll('#samples button')].find((b) => b.textContent.startsWith('{} · disk'))"
    browser.wait(f"{choose.format('newer')} !== undefined")
    browser.run(f"{choose.format('older')}.click()")
    browser.wait("document.getElementById('sample').textContent === 'older'")
    browser.run("document.getElementById('keep').click()")
    browser.run(f"{choose.format('newer')}.click()")
    browser.wait("document.getElementById('sample').textContent === 'newer'")
    assert browser.run("document.getElementById('kept-name').textContent") == "older · disk"
    for theme in ("light", "dark"):
        browser.run(
            f"if (document.documentElement.dataset.theme !== '{theme}') document.getElementById('theme').click()"
        )
        assert browser.run(GREEN) > 200, "the kept curve is drawn"
        keep_picture(browser, pictures, f"page-compared-{theme}.png")

    link = "[...document.querySelectorAll('#downloads a')].find((a) => a.textContent === 'report (PDF)')"
    began = (
        f"fetch({link}.href).then((r) => r.blob()).then(async (b) => [b.type, b.size, (await b.text()).slice(0, 5)])"
    )
    kind, size, begins = browser.run(began)
    assert (kind, begins) == ("application/pdf", "%PDF-")
    assert size > 50_000

    browser.run("document.activeElement.blur(); window.scrollTo(0, 0)")
    wanted, reached = set(browser.run(REACHABLE)), set[str]()
    for _ in range(2 * len(wanted)):
        browser.key("Tab")
        reached.add(browser.run(f"({NAMED})(document.activeElement)"))
    assert wanted - reached == set()
    assert any(one.startswith("BUTTON next Measure ml1") for one in wanted)
    assert browser.problems == []


@needs_chromium
def test_what_changed_from_the_kept_measurement_is_said_and_drawn(
    page: str, lab: Client, browser: Browser, pictures: Path | None
) -> None:
    plan = SweepPlan((Segment(3.5e6, 4.8e6, 101),))
    for name in ("yesterday", "today"):
        build = replace(read_build(THESIS_BUILD), name=name, plan=plan)
        lab.wait_fit("mason", lab.measure(build, "disk").id)
    browser.open(page)
    press(browser, "#samples", "yesterday · disk")
    browser.wait("document.getElementById('sample').textContent === 'yesterday'")
    browser.run("document.getElementById('keep').click()")
    press(browser, "#samples", "today · disk")
    browser.wait("document.getElementById('sample').textContent === 'today'")
    browser.run("document.getElementById('compare').click()")
    assert browser.run("document.getElementById('compare').disabled"), "asked once"
    browser.wait("!document.getElementById('changed').hidden")
    assert "Nothing changed" in browser.run("document.getElementById('changed-words').textContent")
    assert browser.run("document.querySelectorAll('#changed canvas').length") == 2
    assert browser.run("document.getElementById('changed-table').scrollWidth <= document.body.clientWidth")
    keep_picture(browser, pictures, "page-changed.png")
    # It is gone with the pair.
    browser.run("document.getElementById('keep').click()")
    assert browser.run("document.getElementById('changed').hidden && document.getElementById('compare').hidden")
    assert browser.problems == []


STOP = """new Promise((done) => {
    const stop = document.getElementById('stop');
    const look = () => stop.disabled ? setTimeout(look, 20) : done(stop.click());
    look();
})"""
"""As soon as it is enabled."""
NAMED = "(one) => `${one.tagName} ${one.id} ${one.textContent.slice(0, 60)}`"
REACHABLE = f"""[...document.querySelectorAll('a[href], button, input, select')]
    .filter((one) => !one.disabled && one.checkVisibility()).map({NAMED})"""
GREEN = """(() => {
    const canvas = document.querySelector('#plot-z canvas'), ink = canvas.getContext('2d');
    const name = getComputedStyle(document.documentElement).getPropertyValue('--good').trim();
    const box = document.createElement('canvas').getContext('2d');
    box.fillStyle = name;
    box.fillRect(0, 0, 1, 1);
    const [r, g, b] = box.getImageData(0, 0, 1, 1).data, all = ink.getImageData(0, 0, canvas.width, canvas.height).data;
    let found = 0;
    for (let k = 0; k < all.length; k += 4) {
        const off = Math.abs(all[k] - r) + Math.abs(all[k + 1] - g) + Math.abs(all[k + 2] - b);
        if (off < 30 && all[k + 3] > 200) found += 1;
    }
    return found;
})()"""
