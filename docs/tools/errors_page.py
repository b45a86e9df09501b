"""Generates docs/errors.md: every kind of error for people, from the error classes.

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

An error is one sentence on standard error, `pzctl: what, where, what was found, what is allowed`, and the exit status.
`make docs` generates this page from the code; do not edit it.

Exit status 2: something in the request, or in the files or devices that it refers to, is wrong. 1: the request is
valid, but no result is possible.

"""

_SENTENCES = """
## Sentences

Tests provoke {provoked} of the {all} places in the code that create an error; the table lists the resulting sentences.
`make errors` updates it.

"""
_UNPROVOKED = """
## Not provoked

Sentences that no test provokes, and the reason.

| sentence | where | why |
|---|---|---|
"""
_LONGEST = 400


def error_kinds() -> list[type[PzctlError]]:
    """Return every kind of error of the package, sorted by module and name."""
    for room in ("models", "drivers", "fitters", "sim", "daemon"):
        found = importlib.import_module(f"pzctl.{room}")
        for module in pkgutil.walk_packages(found.__path__, f"{found.__name__}."):
            importlib.import_module(module.name)
    kinds = {kind for kind in _below(PzctlError) if kind.__module__.startswith("pzctl.")}
    return sorted(kinds - {PzctlError, CannotError}, key=lambda kind: (kind.__module__, kind.__name__))


def page(provoked: Path | None = None) -> str:
    """Return the page as Markdown; `provoked`: the rows written by the tests, for the table of sentences.

    `unprovoked.toml` in the same folder lists by file the beginning of each sentence that no test provokes, and why.
    """
    rows = ["| kind | where it comes from | exit status | what it is about |", "|---|---|---|---|"]
    for kind in error_kinds():
        about = inspect.cleandoc(kind.__doc__ or "").splitlines()[0].replace("|", "\\|")
        where = Path(inspect.getfile(kind)).relative_to(_ROOT).as_posix()
        rows.append(f"| `{kind.__name__}` | `{where}` | {kind.exit_status} | {about} |")
    return _HEAD + "\n".join(rows) + "\n" + (_sentences(provoked) if provoked is not None else "")


@cache
def all_sites() -> tuple[Site, ...]:
    """Return every place in the code that creates an error."""
    return tuple(sites(_ROOT, [PzctlError.__name__, CannotError.__name__, *(kind.__name__ for kind in error_kinds())]))


def rows_of(provoked: Path) -> list[dict[str, Any]]:
    """Return the sentences provoked by tests, by place, as far as they are still in the code."""
    found = [json.loads(line) for line in provoked.read_text(encoding="utf-8").splitlines()]
    known = all_sites()
    return sorted(
        (row for row in found if any(site.made(row) for site in known)), key=lambda row: (row["where"], row["line"])
    )


def _sentences(provoked: Path) -> str:
    """Return the table of provoked sentences, and the table of those that no test provokes."""
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
        f"| {_plain(site.template or 'the sentence of another error')} | `{site.where}` | {_why(site, reasons)} |"
        for site in left
    ]
    return text + (_UNPROVOKED + "\n".join(lines) + "\n" if lines else "")


def _why(site: Site, reasons: Mapping[str, Mapping[str, str]]) -> str:
    of_file = reasons.get(site.where, {})
    return next((why for begins, why in of_file.items() if site.template.startswith(begins)), "not yet")


def _plain(says: str) -> str:
    """Return a sentence escaped for a table."""
    says = shown(" ".join(says.split()))
    says = says if len(says) <= _LONGEST else f"{says[:_LONGEST]} ..."
    return re.sub(r"([|<>*_`\[\]\\$])", r"\\\1", says)


def _below(kind: type[PzctlError]) -> set[type[PzctlError]]:
    return {kind}.union(*(_below(one) for one in kind.__subclasses__()))


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.write_text(page(target.with_name("provoked.jsonl")), encoding="utf-8")
