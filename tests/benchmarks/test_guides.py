"""The guides that diagnose, exactly as written: all points, the whole catalogue, and the search for a law."""

import re
import sys
from pathlib import Path

import pytest
from guides import run_guide

DOCS = Path(__file__).resolve().parents[2] / "docs"
DIAGNOSES = re.compile(r"<!-- run -->\n```\w*\n(?:(?!```).)*^pzctl (?:diagnose|compare) ", re.DOTALL | re.MULTILINE)
PAGES = sorted(path.name for path in DOCS.glob("*.md") if DIAGNOSES.search(path.read_text(encoding="utf-8")))


@pytest.mark.skipif(sys.platform == "win32", reason="the blocks are for a POSIX shell")
@pytest.mark.parametrize("name", PAGES)
def test_a_guide_works_as_written(name: str, tmp_path: Path) -> None:
    run_guide((DOCS / name).read_text(encoding="utf-8"), tmp_path, None)
    if name == "not-in-the-list.md":
        assert 'effect = "learned"' in (tmp_path / "S1.toml").read_text(encoding="utf-8")
