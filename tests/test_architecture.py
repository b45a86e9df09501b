"""docs/architecture.md and the decisions name existing modules, names, folders and contracts."""

import re
import tomllib
from collections import Counter
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


LARGEST_FOLDER = 20
FOLDER_OF_A_CATALOGUE = "models/effects"
"""One module for each effect."""
KNOWN_TWICE = {
    # A set of effects for a diagnosis and a set of changes for a comparison: what the evidence is of, in both packages.
    "fitters": {"Hypothesis", "hypothesis"},
}
"""Names that are used twice, with the reason; the list only gets shorter."""


PUBLIC_CLASS = re.compile(r"^class ([A-Za-z]\w*)", re.MULTILINE)


def modules_of(floor: str) -> list[Path]:
    return [path for path in (ROOT / floor).rglob("*.py") if not path.name.startswith("__")]


@pytest.mark.parametrize("floor", FLOORS)
def test_no_folder_is_crowded(floor: str) -> None:
    sizes = Counter(str(path.parent.relative_to(ROOT)) for path in modules_of(floor))
    assert not {name: n for name, n in sizes.items() if n > LARGEST_FOLDER and name != FOLDER_OF_A_CATALOGUE}


@pytest.mark.parametrize("floor", FLOORS)
def test_no_two_modules_or_public_classes_have_one_name(floor: str) -> None:
    """Packages of analyzers each have the same modules, as each has the same parts."""
    classes: Counter[str] = Counter()
    modules: Counter[tuple[str, str]] = Counter()
    for path in modules_of(floor):
        package = path.relative_to(ROOT / floor).parts[0] if floor == "drivers" else ""
        modules[package, path.stem] += 1
        classes.update(set(PUBLIC_CLASS.findall(path.read_text(encoding="utf-8"))))
    twice = {name for name, n in classes.items() if n > 1} | {name for (_, name), n in modules.items() if n > 1}
    assert twice == KNOWN_TWICE.get(floor, set())
