"""The guides work as written: every block marked `<!-- run -->` is run, page by page, with fewer points and effects.

`<!-- file: NAME -->` before a block writes it into a file of that name; `<!-- tested: FILE -->` names the test that
runs a block's content.
"""

import re
import shlex
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
from errors_page import all_sites, error_kinds, page, rows_of
from fork_server import ForkServer
from guides import BLOCK, run_guide
from typer.main import get_command

from pzctl.daemon.cli.commands import app
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.bench.bench_errors import BenchError
from pzctl.sim.bench.hidden_effects import KINDS
from pzctl.sim.bench.jig import JIGS
from pzctl.sim.server import SimOptions, running

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
GUIDES = sorted([*DOCS.rglob("*.md"), ROOT / "README.md"])
FENCED = re.compile(r"(?:^|\n)([^\n]*)\n```(\w*)\n(.*?)```", re.DOTALL)
SHOWN = re.compile(r"^<!-- tested: (\S+) -->$")
INDENTED = re.compile(r"^    pzctl (.*)$", re.MULTILINE)
LEAST_PART = 0.2
"""Fraction of all error sentences that may be new since `make errors` was run, or cannot be provoked by a test."""
COMMAND = re.compile(r"^pzctl (.*)$", re.MULTILINE)
POINTS = re.compile(r"points = (\d+)")
MOST_POINTS = 41
PAUSE = re.compile(r'^(wait|every) = "\d+s"', re.MULTILINE)
"""Of a queue."""
WHOLE_CATALOGUE = re.compile(r"^(pzctl diagnose) (?!.*--effects)(?=.*=)", re.MULTILINE)
FEW_EFFECTS = r"\1 --effects lead-inductance "
LEARNS = re.compile(r"^pzctl diagnose .*--learn .*$", re.MULTILINE)
LEARNED = re.compile(r"```toml\n(\[\[effects\]\]\neffect = \"learned\"\n.*?)```", re.DOTALL)
APPENDED = "cat >> S1.toml <<'TOML'\n{}TOML"
"""Diagnoses that would try the whole catalogue, and a search for a law, in place of which the guide's own lines are
written; tests/benchmarks/test_guides.py runs both."""
PAGES = sorted(path.name for path in DOCS.glob("*.md") if BLOCK.search(path.read_text(encoding="utf-8")))

AS_FOR_USERS = ("reading-the-numbers.md",)
"""Pages whose commands begin as new interpreters; those of the others are forked, which saves their imports."""


def _shorter(guide: str) -> str:
    """Return the same guide in a time that can be waited for."""
    guide = POINTS.sub(lambda points: f"points = {min(int(points[1]), MOST_POINTS)}", guide)
    guide = guide.replace("for name in S1 S2 S3;", "for name in S1 S2;")
    guide = PAUSE.sub(r'\1 = "0.1s"', guide)
    if learned := LEARNED.search(guide):
        guide = LEARNS.sub(lambda _: APPENDED.format(learned[1]), guide)
    return WHOLE_CATALOGUE.sub(FEW_EFFECTS, guide)


@pytest.mark.skipif(sys.platform == "win32", reason="the blocks are for a POSIX shell")
@pytest.mark.parametrize("name", PAGES)
def test_every_command_of_a_guide_works(name: str, tmp_path: Path, fork_server: ForkServer | None) -> None:
    server = None if name in AS_FOR_USERS else fork_server
    run_guide(_shorter((DOCS / name).read_text(encoding="utf-8")), tmp_path, server)


@pytest.mark.parametrize("guide", GUIDES, ids=lambda path: path.name)
def test_every_block_is_run_here_or_by_its_named_test(guide: Path) -> None:
    for before, language, text in FENCED.findall(guide.read_text(encoding="utf-8")):
        named = SHOWN.match(before)
        if named:
            assert (ROOT / named[1]).exists(), f"{guide.name} says {named[1]} tests a block; there is no such file"
        elif language != "text":  # the output of a program
            assert before == "<!-- run -->" or before.startswith("<!-- file: "), f"{guide.name}: nobody runs\n{text}"


def test_every_command_in_a_guide_exists() -> None:
    whole: Any = get_command(app)
    for guide in GUIDES:
        text = guide.read_text(encoding="utf-8")
        fenced = [line for _, _, block in FENCED.findall(text) for line in COMMAND.findall(block)]
        for line in [*fenced, *INDENTED.findall(text)]:
            words = shlex.split(re.split(r" [|>&]( |$)| \.\.\.", line)[0], comments=True)
            command, name = whole, "pzctl"
            while words and hasattr(command, "commands") and not words[0].startswith("-"):
                assert words[0] in command.commands, f"{guide.name}: pzctl {line}"
                command, name = command.commands[words[0]], words.pop(0)
            if not hasattr(command, "commands") and "..." not in line:
                command.make_context(name, [word for word in words if word != ">"])  # it refuses an unknown command


def test_the_page_of_the_simulator_has_every_option_and_every_command_of_the_bench() -> None:
    text = (DOCS / "simulator.md").read_text(encoding="utf-8")
    whole: Any = get_command(app)
    options = {option for one in whole.commands["sim"].params for option in (*one.opts, *one.secondary_opts)}
    with running(SimOptions(port=0, bench_port=0)) as sim, pytest.raises(BenchError) as refused:
        bench_command("127.0.0.1", sim.bench_port, command="?")
    commands = str(refused.value).partition("there are ")[2].split(", ")
    for name in {*options, *JIGS, *KINDS, *commands} - {"--noise", "--quiet", "-q", "--help"}:
        assert re.search(rf"`{name}( |`)", text), name


def test_links_between_pages_are_valid() -> None:
    for path in DOCS.glob("*.md"):
        for target in re.findall(r"\]\(([^)#:\s]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_every_kind_of_error_is_on_its_page_with_a_sentence() -> None:
    text = page()
    for kind in error_kinds():
        assert kind.__doc__, f"{kind.__name__} says nothing of itself"
        assert f"`{kind.__name__}`" in text


def test_every_sentence_on_the_page_of_errors_names_an_existing_test() -> None:
    named = re.findall(
        r"`(tests/[\w/]+\.py)::(\w+)` \|$", (DOCS / "errors.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert named
    for file, test in set(named):
        path = ROOT / file
        assert path.exists(), file
        assert f"def {test}(" in path.read_text(encoding="utf-8"), f"{file} has no {test}"


def test_nearly_every_sentence_is_provoked_by_a_test() -> None:
    found, known = rows_of(DOCS / "provoked.jsonl"), all_sites()
    left = [site for site in known if not any(site.made(row) for row in found)]
    assert len(known) > 400
    assert len(left) < LEAST_PART * len(known), [f"{site.where}: {site.template}" for site in left]


def test_the_generator_builds_the_pages(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    if not (ROOT / "mkdocs.yml").exists():
        pytest.skip("not a checkout, so there are no guides")
    words = ["-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "<math" in (tmp_path / "site" / "physics.html").read_text(encoding="utf-8")
    assert "first-measurement.html" in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"pzctl {version}" in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")


def test_every_fitter_is_in_the_table_of_fitters_and_has_a_page() -> None:
    table = (DOCS / "fitters.md").read_text(encoding="utf-8")
    own = [point.name for point in entry_points(group="pzctl.fitters") if point.value.startswith("pzctl.")]
    assert len(own) > 5
    for name in own:
        assert f"[`{name}`](fitters/{name}.md)" in table
        assert (DOCS / "fitters" / f"{name}.md").exists()
