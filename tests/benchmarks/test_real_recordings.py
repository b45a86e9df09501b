"""All published recordings with all points and the whole catalogue; the page docs/real-recordings.md (`make bench`)."""

from pathlib import Path

from pzctl.daemon.cli.proof.real_page import write_page


def test_every_recording_is_diagnosed(recordings: Path, tmp_path: Path) -> None:
    page = tmp_path / "real-recordings.md"
    answers = {one.device.name: one for one in write_page(recordings, page)}
    print(page.read_text())
    (rim,) = (one for one in answers["disk-20x2/thickness-mode"].findings if one.effect == "lateral-modes")
    assert "c11E" in rim.parameters, "in two dimensions"
    for name in ("MD1", "sampleadmittance"):
        assert [one.effect for one in answers[f"hp4294a-exports/{name}"].findings][:1] == ["polarity"]
    for name in ("T61", "T64"):
        assert answers[f"pvdf-on-kapton/{name}"].verdict != "no-mismatch"
    assert len(answers) == len({path for one in answers.values() for path in one.device.paths}) - 1  # two of one disk
