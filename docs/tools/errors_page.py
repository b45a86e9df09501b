"""The page docs/errors.md: every kind of error that people read, from the classes themselves.

python docs/tools/errors_page.py docs/errors.md
"""

import importlib
import inspect
import json
import pkgutil
import re
import sys
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from error_sites import Site, sites

import pzctl
from pzctl.models.base.errors import CannotError, PzctlError
from pzctl.models.base.names import shown

_ROOT = Path(pzctl.__file__).parent
_HEAD = """# Error messages

What is wrong is one sentence on standard error, `pzctl: what, where, what was found, what is allowed`, and the exit
status.
This page is written by `make docs` from the code; do not edit it.

Exit status 2: what was asked, or what it was asked of, is not as it must be. 1: the question was right, and the answer
is "it cannot be done".

"""

_SENTENCES = """
## Sentences

{provoked} of the {all} places in the code that make an error were provoked by a test; below is what was read there.
`make errors` writes them down anew.

"""
_UNPROVOKED = """
## Not provoked

What stands here no test has provoked, and why.

| sentence | where | why |
|---|---|---|
"""
_LONGEST = 400


def error_kinds() -> list[type[PzctlError]]:
    """Return every kind of error of the package, sorted by room and name."""
    for room in ("models", "drivers", "fitters", "sim", "daemon"):
        found = importlib.import_module(f"pzctl.{room}")
        for module in pkgutil.walk_packages(found.__path__, f"{found.__name__}."):
            importlib.import_module(module.name)
    kinds = {kind for kind in _below(PzctlError) if kind.__module__.startswith("pzctl.")}
    return sorted(kinds - {PzctlError, CannotError}, key=lambda kind: (kind.__module__, kind.__name__))


def page(provoked: Path | None = None) -> str:
    """Return the page as Markdown; `provoked`: the rows that the tests wrote, for the table of sentences.

    Beside it lies `unprovoked.toml`: by file, the beginning of a sentence that no test provokes, and why.
    """
    rows = ["| kind | where it comes from | exit status | what it is about |", "|---|---|---|---|"]
    for kind in error_kinds():
        about = inspect.cleandoc(kind.__doc__ or "").splitlines()[0].replace("|", "\\|")
        where = Path(inspect.getfile(kind)).relative_to(_ROOT).as_posix()
        rows.append(f"| `{kind.__name__}` | `{where}` | {kind.exit_status} | {about} |")
    return _HEAD + "\n".join(rows) + "\n" + (_sentences(provoked) if provoked is not None else "")


@cache
def all_sites() -> tuple[Site, ...]:
    """Return every place in the code that makes an error."""
    return tuple(sites(_ROOT, [PzctlError.__name__, CannotError.__name__, *(kind.__name__ for kind in error_kinds())]))


def rows_of(provoked: Path) -> list[dict[str, Any]]:
    """Return what the tests wrote down, by place, as far as the code still says it."""
    found = [json.loads(line) for line in provoked.read_text(encoding="utf-8").splitlines()]
    known = all_sites()
    return sorted(
        (row for row in found if any(site.made(row) for site in known)), key=lambda row: (row["where"], row["line"])
    )


def _sentences(provoked: Path) -> str:
    """Return the table of sentences, each as a test has provoked it, and the table of those that none provokes."""
    found, known = rows_of(provoked), all_sites()
    rows = ["| sentence | kind | provoked by |", "|---|---|---|"]
    seen: set[Site] = set()
    for row in found:
        site = next(site for site in known if site.made(row))
        if site not in seen:
            seen.add(site)
            rows.append(f"| {_plain(row['says'])} | `{row['kind']}` | `{row['test'].partition('[')[0]}` |")
    left = [site for site in known if not any(site.made(row) for row in found)]
    text = _SENTENCES.format(provoked=len(known) - len(left), all=len(known)) + "\n".join(rows) + "\n"
    reasons = tomllib.loads(provoked.with_name("unprovoked.toml").read_text(encoding="utf-8"))
    lines = [
        f"| {_plain(site.template or 'what another part said')} | `{site.where}` | {_why(site, reasons)} |"
        for site in left
    ]
    return text + (_UNPROVOKED + "\n".join(lines) + "\n" if lines else "")


def _why(site: Site, reasons: Mapping[str, Mapping[str, str]]) -> str:
    of_file = reasons.get(site.where, {})
    return next((why for begins, why in of_file.items() if site.template.startswith(begins)), "not yet")


def _plain(says: str) -> str:
    """Return a sentence as it can stand in a table."""
    says = shown(" ".join(says.split()))
    says = says if len(says) <= _LONGEST else f"{says[:_LONGEST]} ..."
    return re.sub(r"([|<>*_`\[\]\\$])", r"\\\1", says)


def _below(kind: type[PzctlError]) -> set[type[PzctlError]]:
    return {kind}.union(*(_below(one) for one in kind.__subclasses__()))


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.write_text(page(target.with_name("provoked.jsonl")), encoding="utf-8")
