"""Every promise of docs/security.md names an existing test, and every file of tests/security has a promise."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
GUIDE = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
ROWS = [line for line in GUIDE.splitlines() if line.startswith("|") and not re.match(r"\| promise|\|---", line)]


def names_in(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}


def test_every_promise_names_an_existing_test() -> None:
    assert len(ROWS) > 50
    for row in ROWS:
        named = re.fullmatch(r"\| .+ \| (?:stranger|client|user|accident|writer) \| `(\S+)::(\w+)` \|", row)
        assert named, f"no promise | against | test: {row}"
        assert (ROOT / named[1]).exists(), row
        assert named[2] in names_in(ROOT / named[1]), row


def test_every_file_of_these_tests_has_a_promise() -> None:
    files = {path.name for path in HERE.glob("test_*.py")} - {Path(__file__).name}
    assert {name for name in files if f"tests/security/{name}::" not in GUIDE} == set()
