"""Executes the notebooks of the gallery and writes each as .ipynb with its outputs and as a page of the guides.

python docs/tools/gallery.py docs/gallery

The source of a notebook is a Python file with cells, `# %%` for code and `# %% [markdown]` for text. No notebook server
is needed: the cells are run here, one after the other, and the last line of a cell is shown if it is an expression.
"""

import ast
import base64
import contextlib
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

_CELL = re.compile(r"^# %%( \[markdown\])?$", re.MULTILINE)
_HEAD = "<!-- Made by docs/tools/gallery.py from {name}.py; do not edit. -->\n"
_TESTED = "<!-- tested: tests/test_gallery.py -->"
_COLOURS = 32
"""Of a picture: lines, text and grey need no more, and a picture of so few has a quarter of the size."""


@dataclass
class Cell:
    """A cell of a notebook with what it has shown."""

    kind: Literal["markdown", "code"]
    text: str
    printed: str = ""
    pictures: list[bytes] = field(default_factory=list)
    """PNG."""


def cells_of(source: str) -> list[Cell]:
    """Return the cells of a notebook's source."""
    parts = _CELL.split(source)[1:]
    cells: list[Cell] = []
    for marked, text in zip(parts[::2], parts[1::2], strict=True):
        if marked:
            lines = [line.removeprefix("#").removeprefix(" ") for line in text.strip().splitlines()]
            cells.append(Cell("markdown", "\n".join(lines)))
        else:
            cells.append(Cell("code", text.strip()))
    return cells


def execute(cells: list[Cell]) -> None:
    """Run the code of a notebook in a folder of its own, and keep what each cell shows."""
    names: dict[str, Any] = {"__name__": "__notebook__"}
    with _own_folder():
        for cell in (cell for cell in cells if cell.kind == "code"):
            body = ast.parse(cell.text).body
            last = ast.Expression(body.pop().value) if body and isinstance(body[-1], ast.Expr) else None
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile(ast.Module(body, []), "cell", "exec"), names)  # noqa: S102 (our own notebooks)
                shown = None if last is None else eval(compile(last, "cell", "eval"), names)  # noqa: S307
            if hasattr(shown, "savefig"):
                cell.pictures.append(_png(shown))
            elif shown is not None:
                printed.write(str(shown))
            cell.printed = re.sub(r"[ \t]+$", "", printed.getvalue(), flags=re.MULTILINE).strip("\n")


def as_notebook(cells: list[Cell]) -> str:
    """Return a notebook file, format 4."""
    made: list[dict[str, Any]] = []
    for k, cell in enumerate(cells):
        plain: dict[str, Any] = {"cell_type": cell.kind, "id": f"cell-{k}", "metadata": {}}
        plain["source"] = cell.text.splitlines(keepends=True)
        if cell.kind == "code":
            plain |= {"execution_count": None, "outputs": _outputs(cell)}
        made.append(plain)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def as_page(cells: list[Cell], name: str) -> tuple[str, dict[str, bytes]]:
    """Return the page in Markdown and its pictures by file name."""
    parts, pictures = [_HEAD.format(name=name)], dict[str, bytes]()
    for cell in cells:
        if cell.kind == "markdown":
            parts.append(f"{cell.text}\n")
            continue
        parts.append(f"{_TESTED}\n```python\n{cell.text}\n```\n")
        if cell.printed:
            parts.append(f"```text\n{cell.printed}\n```\n")
        for picture in cell.pictures:
            file = f"{name}-{len(pictures) + 1}.png"
            pictures[file] = picture
            parts.append(f"![]({file})\n")
    parts.append(f"The notebook: [{name}.ipynb]({name}.ipynb)\n")
    return "\n".join(parts), pictures


def _outputs(cell: Cell) -> list[dict[str, Any]]:
    outputs: list[dict[str, Any]] = []
    if cell.printed:
        outputs.append({"name": "stdout", "output_type": "stream", "text": cell.printed.splitlines(keepends=True)})
    for picture in cell.pictures:
        data = {"image/png": base64.b64encode(picture).decode()}
        outputs.append({"data": data, "metadata": {}, "output_type": "display_data"})
    return outputs


def _png(figure: Any) -> bytes:
    """Return a figure as a small PNG with few colours."""
    from PIL import Image

    large, small = io.BytesIO(), io.BytesIO()
    figure.savefig(large, format="png", dpi=70)
    Image.open(large).convert("RGB").quantize(_COLOURS).save(small, format="png", optimize=True)
    return small.getvalue()


@contextlib.contextmanager
def _own_folder() -> Iterator[None]:
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def main(folder: Path) -> None:
    """Write every notebook and page of the gallery."""
    for path in sorted(folder.glob("*.py")):
        cells = cells_of(path.read_text(encoding="utf-8"))
        execute(cells)
        page, pictures = as_page(cells, path.stem)
        path.with_suffix(".ipynb").write_text(as_notebook(cells), encoding="utf-8")
        path.with_suffix(".md").write_text(page, encoding="utf-8")
        for file, picture in pictures.items():
            (folder / file).write_bytes(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
