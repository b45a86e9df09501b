"""Every Python process that imports this file records the error sentences that tests provoke in it: `make errors`.

PZCTL_PROVOKED=file.jsonl PYTHONPATH=tests/support/provoked_by pytest
"""

import contextlib
import json
import os
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
OF_THIS_MACHINE = re.compile(
    r"(/[\w.-]+)*/pytest-of-\w+/[\w./-]*?/(?=[\w.-]+\b)|/tmp/pzctl-\w+-\w+/?|" + re.escape(str(ROOT)) + r"/([\w.-]+/)*"
)
_seen: set[tuple[str, int]] = set()


def _noted(error: Exception, *words: Any) -> None:
    Exception.__init__(error, *words)
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_name == "__init__" and frame.f_locals.get("self") is error:
        frame = frame.f_back
    place = Path(frame.f_code.co_filename)
    site = (str(place), frame.f_lineno)
    test = os.environ.get("PYTEST_CURRENT_TEST", "").split(" (")[0]
    if site in _seen or not test or not place.is_relative_to(ROOT) or place.is_relative_to(ROOT / "tests"):
        return
    _seen.add(site)
    row = {
        "kind": type(error).__name__,
        "where": place.relative_to(ROOT).as_posix(),
        "line": frame.f_lineno,
        "says": OF_THIS_MACHINE.sub("", str(words[0])) if words else "",
        "test": test,
    }
    with (
        contextlib.suppress(OSError),  # a test that limits the size of files
        Path(os.environ["PZCTL_PROVOKED"]).open("a", encoding="utf-8") as file,
    ):
        file.write(json.dumps(row) + "\n")


if "PZCTL_PROVOKED" in os.environ:
    with contextlib.suppress(ImportError):  # a Python without pzctl has no error sentences
        from pzctl.models.base.errors import PzctlError

        PzctlError.__init__ = _noted  # type: ignore[method-assign, assignment]
