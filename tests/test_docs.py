"""The guides do what they say: every block marked `<!-- run -->` is run as it stands, page by page.

`<!-- file: NAME -->` before a block writes it into a file of that name.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pzctl.daemon.errorspage import error_kinds, page

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
BLOCK = re.compile(r"<!-- (run|file: (\S+)) -->\n```\w*\n(.*?)```", re.DOTALL)
PAGES = sorted(path.name for path in DOCS.glob("*.md") if BLOCK.search(path.read_text(encoding="utf-8")))


@pytest.mark.skipif(sys.platform == "win32", reason="the blocks are for a POSIX shell")
@pytest.mark.parametrize("name", PAGES)
def test_every_command_of_a_guide_works(name: str, tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PZCTL_HOME": str(tmp_path / "home")}
    for kind, file, text in BLOCK.findall((DOCS / name).read_text(encoding="utf-8")):
        if kind != "run":
            (tmp_path / file).write_text(text, encoding="utf-8")
            continue
        shell = shutil.which("bash") or "/bin/sh"
        done = subprocess.run(
            [shell, "-em", "-c", text], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{text}\n{done.stdout[-1500:]}\n{done.stderr[-1500:]}"
        assert "Traceback" not in done.stderr


def test_links_between_pages_lead_somewhere() -> None:
    for path in DOCS.glob("*.md"):
        for target in re.findall(r"\]\(([^)#:\s]+)\)", path.read_text(encoding="utf-8")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_every_kind_of_error_is_on_its_page_with_a_sentence() -> None:
    text = page()
    for kind in error_kinds():
        assert kind.__doc__, f"{kind.__name__} says nothing of itself"
        assert f"`{kind.__name__}`" in text


def test_the_generator_builds_the_pages(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    if not (ROOT / "mkdocs.yml").exists():
        pytest.skip("this is no checkout: the guides are not here")
    words = ["-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "first-measurement.html" in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
