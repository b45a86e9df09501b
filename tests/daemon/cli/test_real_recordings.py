"""Every published recording gets an answer that includes what is known of it and nothing that is known to be wrong."""

from pathlib import Path

import pytest

from pzctl.daemon.cli.proof.real_page import NoRecordingsError, RealAnswer, answered, devices, page_text, write_page

FILM = ("dielectric-dispersion",)
"""The effects tried on a printed film; tests/benchmarks/test_real_recordings.py tries the whole catalogue."""


def answer(recordings: Path, name: str, effects: tuple[str, ...] | None = None, thin: int = 4) -> RealAnswer:
    return answered(next(one for one in devices(recordings) if one.name == name), thin, effects)


def test_every_recording_of_the_folder_is_on_the_page(recordings: Path) -> None:
    listed = {path for device in devices(recordings) for path in device.paths}
    texts = ("analyzer-equivalent-circuit.txt", "README.md")
    there = {path for path in recordings.glob("*/*.*") if path.name not in texts}
    assert listed == there
    assert len({device.name for device in devices(recordings)}) == len(list(devices(recordings)))


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NoRecordingsError, match="none of the published recordings"):
        write_page(tmp_path, tmp_path / "page.md")


def test_an_inverted_export_is_reported(recordings: Path) -> None:
    said = answer(recordings, "hp4294a-exports/MD1")
    assert [one.effect for one in said.findings][:1] == ["polarity"]
    assert said.remaining is not None


@pytest.mark.parametrize("name", ["hp4294a-exports/RB5100", "bar-k31/k31-mode", "air-40khz/trans_25-50k_001_001"])
def test_without_geometry_a_circuit_is_fitted_and_no_effect_is_named(recordings: Path, name: str) -> None:
    said = answer(recordings, name, thin=2)
    assert not said.findings
    assert "`bvd`" in said.verdict
    assert said.remaining is not None
    assert said.remaining > 0.01  # every one of them has more than one resonance


def test_radial_modes_are_fitted_together(recordings: Path) -> None:
    said = answer(recordings, "disk-35x2", thin=1)
    assert said.remaining == pytest.approx(0.0061, rel=0.05)


def test_a_coil_is_not_a_piezoelectric_device(recordings: Path) -> None:
    said = answer(recordings, "air-40khz/coil_150u_25kHz_50kHz")
    assert "not capacitive" in said.says
    assert said.remaining is None
    assert "not capacitive" in page_text([said])


@pytest.mark.long
def test_the_fault_of_a_film_is_reported(recordings: Path) -> None:
    said = answer(recordings, "pvdf-on-kapton/T61", FILM, thin=32)
    assert said.verdict in ("partly-explained", "unexplained")
    assert "pvdf-on-kapton/T61" in page_text([said])
