"""The gallery: its notebooks run, and the files in the docs are made from the sources beside them."""

import json
from pathlib import Path

import pytest
from gallery import as_notebook, cells_of, execute

import pzctl

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "gallery"
SOURCES = sorted(FOLDER.glob("*.py"))


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_notebook_and_page_are_those_of_the_source(source: Path) -> None:
    cells = cells_of(source.read_text(encoding="utf-8"))
    notebook = json.loads(source.with_suffix(".ipynb").read_text(encoding="utf-8"))
    expected = json.loads(as_notebook(cells))["cells"]
    assert [cell["source"] for cell in notebook["cells"]] == [cell["source"] for cell in expected], "run `make docs`"
    shown = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    assert any(output["output_type"] == "display_data" for output in shown)
    page = source.with_suffix(".md").read_text(encoding="utf-8")
    assert all(cell.text in page for cell in cells)
    assert source.stat().st_size + source.with_suffix(".ipynb").stat().st_size < 200_000


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_the_code_compiles_and_uses_public_names(source: Path) -> None:
    code = "\n".join(cell.text for cell in cells_of(source.read_text(encoding="utf-8")) if cell.kind == "code")
    used = {word.split("(")[0].split(".")[1] for word in code.split() if word.startswith("pzctl.")}
    assert used <= set(pzctl.__all__)
    compile(code, source.name, "exec")


def test_a_notebook_runs_and_shows_what_the_page_shows() -> None:
    cells = cells_of((FOLDER / "disk.py").read_text(encoding="utf-8"))
    execute(cells)
    assert any("disk.kt" in cell.printed for cell in cells)
    assert sum(len(cell.pictures) for cell in cells) == 1
