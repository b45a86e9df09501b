"""The page docs/errors.md: every kind of error that people read, from the classes themselves.

python -m pzctl.daemon.errorspage docs/errors.md
"""

import importlib
import inspect
import json
import pkgutil
import re
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

_SENTENCES = """
## Sentences

One of each place in the code where a test has provoked an error, as it was read there; `make errors` writes them down.

"""
_LONGEST = 400


def error_kinds() -> list[type[PzctlError]]:
    """Return every kind of error of the package, sorted by room and name."""
    package = importlib.import_module("..", __package__)
    for room in ("models", "drivers", "fitters", "sim", "daemon"):
        found = importlib.import_module(f"{package.__name__}.{room}")
        for module in pkgutil.walk_packages(found.__path__, f"{found.__name__}."):
            importlib.import_module(module.name)
    kinds = {kind for kind in _below(PzctlError) if kind.__module__.startswith(f"{package.__name__}.")}
    return sorted(kinds - {PzctlError, CannotError}, key=lambda kind: (kind.__module__, kind.__name__))


def page(provoked: Path | None = None) -> str:
    """Return the page as Markdown; `provoked`: the rows that `tests/provoked.py` wrote, for the table of sentences."""
    rows = ["| kind | where it comes from | exit status | what it is about |", "|---|---|---|---|"]
    for kind in error_kinds():
        about = inspect.cleandoc(kind.__doc__ or "").splitlines()[0].replace("|", "\\|")
        where = Path(inspect.getfile(kind)).relative_to(_ROOT).as_posix()
        rows.append(f"| `{kind.__name__}` | `{where}` | {kind.exit_status} | {about} |")
    return _HEAD + "\n".join(rows) + "\n" + (_sentences(provoked) if provoked is not None else "")


def _sentences(provoked: Path) -> str:
    """Return the table of sentences, each as a test has provoked it."""
    found = [json.loads(line) for line in provoked.read_text(encoding="utf-8").splitlines()]
    found.sort(key=lambda row: (row["where"], row["line"]))
    rows = ["| sentence | kind | provoked by |", "|---|---|---|"]
    seen: set[str] = set()
    for row in found:
        says, test = _plain(row["says"]), row["test"].partition("[")[0]
        if says and says not in seen:
            seen.add(says)
            rows.append(f"| {says} | `{row['kind']}` | `{test}` |")
    return _SENTENCES + "\n".join(rows) + "\n"


def _plain(says: str) -> str:
    """Return a sentence as it can stand in a table."""
    says = " ".join(says.split())
    says = says if len(says) <= _LONGEST else f"{says[:_LONGEST]} ..."
    return re.sub(r"([|<>*_`\[\]\\$])", r"\\\1", says)


def _below(kind: type[PzctlError]) -> set[type[PzctlError]]:
    return {kind}.union(*(_below(one) for one in kind.__subclasses__()))


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.write_text(page(target.with_name("provoked.jsonl")), encoding="utf-8")
