"""Picture files: allowed names, labels, and writing."""

from pathlib import Path
from typing import Any

from ....models.base.errors import PzctlError
from ....models.base.names import shown

KINDS = (".png", ".svg", ".pdf")


class PictureError(PzctlError):
    """A picture cannot be written to the given path."""


def as_label(text: str) -> str:
    """Return text from outside for matplotlib, with `$` escaped so that it starts no formula."""
    return shown(text, keep="\n").replace("$", r"\$")


def place_no_labels(grid: Any) -> None:
    """Give axes inside a grid, which have no labels, a place for them: matplotlib looks for one, a third of drawing."""
    for axes in grid[:-1].flat:
        axes.xaxis.set_label_coords(0, 0)
    for axes in grid[:, 1:].flat:
        axes.yaxis.set_label_coords(0, 0)


def few_minor_ticks(axes: Any) -> None:
    """Give a logarithmic axis two minor ticks for each decade: all eight take a quarter of the drawing."""
    from matplotlib.ticker import LogLocator

    axes.yaxis.set_minor_locator(LogLocator(subs=(2, 5)))


def check_picture(path: Path) -> None:
    """Refuse a path that a picture cannot be written to, before any work is done. Raises PictureError."""
    if path.is_dir():
        raise PictureError(f"{path}: this is a folder; a file name is needed, such as {path / 'fit.png'}")
    if path.suffix.lower() not in KINDS:
        raise PictureError(f"{path}: the name ends with {path.suffix!r}; allowed are {', '.join(KINDS)}")


def save_picture(figure: Any, path: Path, dpi: int) -> Path:
    """Write a matplotlib figure, making its folder if missing, and return the path. Raises PictureError."""
    check_picture(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=dpi)
    except OSError as error:
        raise PictureError(f"{path}: the picture cannot be written: {error.strerror or error}") from None
    return path
