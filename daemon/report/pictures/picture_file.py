"""The file of a picture: what its name may be, and what is said where it cannot be written."""

from pathlib import Path
from typing import Any

from ....models.base.errors import PzctlError
from ....models.base.names import shown

KINDS = (".png", ".svg", ".pdf")


class PictureError(PzctlError):
    """A picture that cannot be written where it is wanted."""


def as_label(text: str) -> str:
    """Return text from outside as matplotlib is to draw it: `$` begins no formula."""
    return shown(text, keep="\n").replace("$", r"\$")


def check_picture(path: Path) -> None:
    """Refuse a path that no picture can go to, before any work is done. Raises PictureError."""
    if path.is_dir():
        raise PictureError(f"{path}: this is a folder; the name of a file is needed, as {path / 'fit.png'}")
    if path.suffix.lower() not in KINDS:
        raise PictureError(f"{path}: no picture has a name that ends so; allowed are {', '.join(KINDS)}")


def save_picture(figure: Any, path: Path, dpi: int) -> Path:
    """Write a figure of matplotlib's, its folder made if it is not there; return the path. Raises PictureError."""
    check_picture(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=dpi)
    except OSError as error:
        raise PictureError(f"{path}: the picture cannot be written: {error.strerror or error}") from None
    return path
