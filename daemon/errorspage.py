"""The page docs/errors.md: every kind of error that people read, from the classes themselves.

python -m pzctl.daemon.errorspage docs/errors.md
"""

import importlib
import inspect
import pkgutil
import sys
from pathlib import Path

from ..models.errors import CannotError, PzctlError

_ROOT = Path(__file__).parents[1]
_HEAD = """# Error messages

What is wrong is one sentence on standard error, `pzctl: what, where, what was found, what is allowed`, and the exit
status.
This page is written by `make docs` from the code; do not edit it.

Exit status 2: what was asked, or what it was asked of, is not as it must be. 1: the question was right, and the answer
is "it cannot be done".

"""


def error_kinds() -> list[type[PzctlError]]:
    """Return every kind of error of the package, sorted by room and name."""
    package = importlib.import_module("..", __package__)
    for room in ("models", "drivers", "fitters", "sim", "daemon"):
        found = importlib.import_module(f"{package.__name__}.{room}")
        for module in pkgutil.walk_packages(found.__path__, f"{found.__name__}."):
            importlib.import_module(module.name)
    kinds = {kind for kind in _below(PzctlError) if kind.__module__.startswith(f"{package.__name__}.")}
    return sorted(kinds - {PzctlError, CannotError}, key=lambda kind: (kind.__module__, kind.__name__))


def page() -> str:
    """Return the page as Markdown."""
    rows = ["| kind | where it comes from | exit status | what it is about |", "|---|---|---|---|"]
    for kind in error_kinds():
        about = inspect.cleandoc(kind.__doc__ or "").splitlines()[0].replace("|", "\\|")
        where = Path(inspect.getfile(kind)).relative_to(_ROOT).as_posix()
        rows.append(f"| `{kind.__name__}` | `{where}` | {kind.exit_status} | {about} |")
    return _HEAD + "\n".join(rows) + "\n"


def _below(kind: type[PzctlError]) -> set[type[PzctlError]]:
    return {kind}.union(*(_below(one) for one in kind.__subclasses__()))


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
