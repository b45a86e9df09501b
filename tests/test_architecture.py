"""docs/architecture.md and the decisions name existing modules, names, folders and contracts."""

import re
import tomllib
from functools import reduce
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLOORS = ("daemon", "drivers", "fitters", "models", "sim")
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
DECISIONS = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "decisions").glob("*.md"))
NAMED = sorted(set(re.findall(r"`([\w/]+\.py)(?::([\w.]+))?`", PAGE + DECISIONS)))


@pytest.mark.parametrize(("path", "name"), NAMED, ids=[":".join(filter(None, one)) for one in NAMED])
def test_every_module_and_name_exists(path: str, name: str) -> None:
    assert (ROOT / path).exists()
    if name:
        module = import_module(".".join(("pzctl", *Path(path).with_suffix("").parts)).removesuffix(".__init__"))
        reduce(getattr, name.split("."), module)


def test_every_folder_exists_and_every_package_is_named() -> None:
    folders = set(re.findall(r"`([\w/]+)/`", PAGE))
    assert {folder for folder in folders if not (ROOT / folder).is_dir()} == set()
    rooms = {f"{floor}/{path.parent.name}" for floor in FLOORS for path in (ROOT / floor).glob("*/__init__.py")}
    assert rooms - folders == set()


def test_the_contracts_are_those_of_the_import_linter() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    table = PAGE.partition("## The rules")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE)[1:]
    assert sorted(rows) == sorted(contract["name"] for contract in contracts)


def test_the_picture_shows_every_room() -> None:
    picture = (ROOT / "docs" / "pictures" / "architecture.svg").read_text(encoding="utf-8")
    shown = set(re.findall(r">(\w+)</text>", picture))
    rooms = {path.parent.name for floor in FLOORS for path in (ROOT / floor).glob("*/__init__.py")}
    assert {*rooms, *FLOORS} - shown == set()
