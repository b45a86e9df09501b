"""Analyzers are found by their entry points, and only its own folder knows an analyzer."""

import ast
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from pzctl.drivers import analyzers, capabilities_of, open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError

ROOT = Path(__file__).parents[2]
KNOW_IT = ("drivers/agilent4294a", "drivers/keysight_e4990a", "drivers/recordings")
"""The analyzer's own folder, and its file formats, which are named like those of others."""


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two entry points of a third party: a missing module, and an object that is not a driver."""
    info = tmp_path / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pzctl.analyzers]\na = no_such_module:DRIVER\nb = math:pi\n")
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.mark.usefixtures("broken")
def test_what_does_not_load_is_named_and_the_others_are_found(play) -> None:
    with closing(open_analyzer(play().resource)) as analyzer:
        assert analyzer.identify().model == "4294A"
    with pytest.raises(InstrumentError) as caught:
        open_analyzer(play({"*IDN?": [b"ACME,Z1000,7,1.0\n"]}).resource)
    says = str(caught.value).replace(" Keysight E4990A,", "")  # an older installation does not have it
    assert says.endswith(
        "the answer to *IDN? is 'ACME,Z1000,7,1.0'; known are HP, Agilent or Keysight 4294A, a recording "
        "(recording:FILE); a of acme does not load: No module named 'no_such_module'; b of acme is not a driver but "
        "float"
    )


def test_capabilities_follow_from_the_identification() -> None:
    known = capabilities_of("HEWLETT-PACKARD,4294A,MY43202956,REV1.11")
    assert (known.frequency_Hz, known.points_per_sweep, known.source_ohm) == ((40.0, 110e6), 801, 25.0)
    assert capabilities_of("") is known, "what is assumed of a recording of unknown origin"


def test_an_installation_from_before_there_were_entry_points_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(analyzers, "GROUP", "pzctl.none")
    for ask in (lambda: capabilities_of(""), lambda: open_analyzer("recording:disk.csv")):
        with pytest.raises(InstrumentError, match="reinstall pzctl with pip"):
            ask()


def test_no_code_elsewhere_names_one_analyzer() -> None:
    """Docstrings and messages may name one."""
    named = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {word}"
        for room in ("models", "drivers", "fitters", "daemon")
        for path in sorted((ROOT / room).rglob("*.py"))
        if not path.relative_to(ROOT).as_posix().startswith(KNOW_IT)
        if "4294" in (text := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        for word in words(node)
        if "4294" in word
    ]
    assert not named


def words(node: ast.AST) -> Iterator[str]:
    """Names, imported modules, and one-word strings, which are not messages."""
    yield from (str(value) for name in ("id", "attr", "name", "module", "arg") if (value := getattr(node, name, None)))
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " not in node.value.strip():
        yield node.value
