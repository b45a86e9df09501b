"""`pzctl report`: the file is complete and self-contained, and a real browser draws it."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.daemon.report.document.html_report import NothingToReport, report_html
from pzctl.daemon.samples.sample_record import sample_record
from pzctl.daemon.samples.sample_selection import open_journal

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
BUILD = THESIS_BUILD
VOID = {"meta", "br", "path"}


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


class Outline(HTMLParser):
    """Headings, ids and external references of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.heads: list[str] = []
        self.ids: list[str] = []
        self.outward: list[str] = []
        self._in_head = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._in_head = tag == "h2"
        for name, value in attrs:
            if name == "id" and value:
                self.ids.append(value)
            if name in ("src", "href", "xlink:href") and value and not value.startswith(("#", "data:")):
                self.outward.append(value)

    def handle_data(self, data: str) -> None:
        if self._in_head:
            self.heads.append(data)
            self._in_head = False


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The report of a simulated transducer after two steps."""
    folder = tmp_path_factory.mktemp("reported")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(folder))
        whole = BUILD.read_text(encoding="utf-8").replace("points = 801", "points = 101")
        (folder / "two.toml").write_text(re.sub(r'\[\[steps\]\]\nname = "ml2"\n.*\n', "", whole), encoding="utf-8")
        done = run("measure", "--build", folder / "two.toml", "--fit", "--time-scale", "0", "--json")
        assert done.exit_code == 0, done.stderr
        done = run("report", "thesis", "--out", folder / "report.html", "--json")
        assert json.loads(done.stdout) == {"sample": "thesis", "report": str(folder / "report.html")}
        yield folder


def test_the_report_is_complete_and_self_contained(reported: Path) -> None:
    text = (reported / "report.html").read_text(encoding="utf-8")
    page = Outline()
    page.feed(text)
    assert page.heads == [
        "What was measured",
        "The transducer",
        "Constants",
        "Fit over measurement",
        "Admittance circles",
        "Misfit, and what it means",
        "From step to step",
        "Uncertainty budget",
        "Correlations",
        "Provenance",
    ]
    assert page.outward == []
    assert not re.search(r"@import|<script|url\((?!#)", text)
    assert len(page.ids) == len(set(page.ids)), "pictures of one page do not share ids"
    assert re.search(r"disk\.c33D</td><td>1\.5\d+\(\d+\)e11 \+ ", text)
    assert "HEWLETT-PACKARD,4294A" in text
    assert "Near 1: model and recording agree" in text
    assert "<image" not in text, "pictures are vector graphics: in a PDF an image would be misplaced"


def test_names_from_outside_cannot_become_markup(reported: Path) -> None:
    journal = open_journal()
    record = sample_record(journal, "thesis")
    journal.close()
    named = replace(record, name="<script>alert(1)</script>", steps=record.steps[:1])
    page = report_html(named)
    assert "&lt;script&gt;alert(1)" in page
    assert "<script" not in page
    with pytest.raises(NothingToReport, match="no fit by 'nobody'"):
        report_html(record, "nobody")


def test_a_measurement_without_a_fit_is_told_from_its_sample(reported: Path) -> None:
    journal = open_journal()
    (measured,) = journal.measurements("sample = 'thesis' AND step = 'disk'")
    record = sample_record(journal, measured.id)
    journal.close()
    assert "Constants" in report_html(record)
    (step,) = record.steps
    unfitted = replace(record, steps=(replace(step, fits=(), refusals=()),))
    refused = replace(record, steps=(replace(step, fits=(), refusals=("mason: too few points",)),))
    failed = replace(record, steps=(replace(step, measurement=replace(measured, state="failed"), fits=()),))
    for one, says in (
        (unfitted, f"it has no fit; `pzctl.connect().fit('{measured.id}', 'mason')` in Python asks a running daemon"),
        (refused, "it has no fit; mason: too few points"),
        (failed, "it has no fit and gets none: it is failed; only complete measurements that count are fitted"),
    ):
        with pytest.raises(NothingToReport) as nothing:
            report_html(one)
        assert str(nothing.value).startswith(f"measurement {measured.id} of sample 'thesis', step 'disk': {says}")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed (Debian: apt-get install chromium)")
def test_a_browser_draws_it(reported: Path) -> None:
    picture = reported / "report.png"
    words = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1280,2400", f"--screenshot={picture}"]
    profile = f"--user-data-dir={reported / 'profile'}"
    done = subprocess.run(
        [str(CHROMIUM), *words, profile, f"file://{reported / 'report.html'}"],
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0
    assert picture.stat().st_size > 100_000, "an empty page makes a small picture"


def test_as_pdf_it_says_the_same(reported: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(reported))
        target = reported / "report.pdf"
        assert run("report", "thesis", "--out", target).exit_code == 0
        refused = run("report", "thesis", "--out", reported / "report.doc")
    assert (refused.exit_code, "allowed are .html, .pdf" in str(refused.exception)) == (1, True)
    import pypdf  # imported late: it takes half a second, in each process of a test run

    pages = [page.get_contents() for page in pypdf.PdfReader(target).pages]
    assert len(pages) >= 4
    strokes = [page.get_data().count(b" l ") for page in pages if page is not None]
    assert max(strokes) > 2000, "the curves are lines, not pixels"
