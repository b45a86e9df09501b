"""A manual fit of a sample in the journal, as in a script or a notebook."""

from dataclasses import replace

import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.report.document.html_report import report_html
from pzctl.daemon.report.fit_widget import FitWidget
from pzctl.daemon.samples.journal_manual_fit import Choices, NobodyError, of_measurement, of_sample
from pzctl.daemon.samples.sample_record import UnknownSampleError, sample_record
from pzctl.daemon.samples.sample_selection import open_journal
from pzctl.models.sweep_plan import Segment, SweepPlan

BUILD = THESIS_BUILD


def test_in_hand_it_begins_where_the_fit_ended_and_a_slider_moves_it(start_daemon) -> None:
    start_daemon(names=("mason",))
    with connect() as lab:
        plan = SweepPlan((Segment(1e6, 6e6, 201), Segment(5e5, 15.5e6, 201)))
        build = replace(read_build(BUILD), plan=plan)
        first = lab.measure(build, "disk")
        lab.wait_fit("mason", first.id)
        lab.bench({"command": "step", "name": "ml1"})
        second = lab.measure(build, "ml1")
        fitted = lab.wait_fit("mason", second.id)
    hand = of_sample("thesis")
    assert hand.steps == ("disk", "ml1")
    assert of_measurement(first.id).steps == ("disk",)
    assert hand.look().chi2_per_dof == pytest.approx(fitted.chi2_per_dof, rel=0.1)
    with pytest.raises(UnknownSampleError, match="step 'ml2' was not measured; measured: disk, ml1"):
        of_sample("thesis", "ml2")
    with pytest.raises(UnknownSampleError, match="no measurement 'x'"):
        of_measurement("x")

    wanted = Choices(free=("disk.c33D",), bands={"disk": ((1e6, 6e6),)}, effects=(("lead-inductance", "terminals"),))
    with pytest.raises(NobodyError, match="by: ' ' is no name"):
        hand.keep(wanted, " ")
    for _ in range(2):  # the daemon takes the second for the first
        made, _ = hand.keep(wanted, "Ana B.")
    with connect() as lab:
        (kept,) = (one.event for one in lab.fits(second.id) if one.event.fitter == "by-hand")
    assert kept.report.version == made.version
    assert kept.report.chosen["by"] == "Ana B."
    assert kept.report.chosen["bands"] == {"disk": [[1e6, 6e6]]}
    assert kept.report.says[0] == (
        "fitted by hand, by Ana B.; free: disk.c33D; bands: disk 1 to 6 MHz; with lead-inductance at terminals."
    )
    assert len(kept.sweeps) == 4
    assert "by Ana B." in report_html(sample_record(open_journal(), "thesis"), "by-hand")

    pytest.importorskip("ipywidgets")
    board = FitWidget(hand, Choices(bands={"disk": ()}))
    before = board._picture.value
    board._slider["ml1.thickness"].value *= 1.05
    assert "<svg" in board._picture.value != before
    for name, tick in board._tick.items():
        tick.value = name == "ml1.thickness"
    board._button.click()
    assert board.result is not None
    assert board.result.steps == ("ml1",)
    assert [name for name, one in board.result.constants.items() if one.free] == ["ml1.thickness"]
    assert board.result.chi2_per_dof < 2, "it found back"
