"""Analyzers are found by their entry points; one that does not load is named and leaves the others alone."""

from contextlib import closing
from pathlib import Path

import pytest

from pzctl.drivers import capabilities_of, open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two packages of somebody else: a module that is missing, and something that is no driver."""
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
    assert str(caught.value).endswith(
        "*IDN? is answered by 'ACME,Z1000,7,1.0'; known are HP, Agilent or Keysight 4294A, a recording "
        "(recording:FILE); a of acme does not load: No module named 'no_such_module'; b of acme is no driver, but float"
    )


def test_what_an_analyzer_can_do_is_known_by_its_identification() -> None:
    known = capabilities_of("HEWLETT-PACKARD,4294A,MY43202956,REV1.11")
    assert (known.frequency_Hz, known.points_per_sweep, known.source_ohm) == ((40.0, 110e6), 801, 25.0)
    assert capabilities_of("") is known, "what is assumed of a recording of unknown origin"
