"""The time that is said to be left is the one that is left, however wrong the analyzer's formula is."""

import pytest

from pzctl.daemon.server.analyzers.pace import Pace
from pzctl.drivers.base.analyzer import Progress


class _Measurement:
    """Two sweeps that take 3 s and 1 s where the formula says 150 s and 50 s; the clock is the test's."""

    def __init__(self, pace: float) -> None:
        self.now = 0.0
        self.said: list[tuple[float, Progress]] = []
        self.pace = Pace(pace, lambda: self.now)

    def run(self) -> None:
        """Report as an analyzer does: elapsed seconds over the formula's."""
        begun = self.now
        progress = self.pace.corrected(200.0, lambda one: self.said.append((4.0 - (self.now - begun), one)))
        for before, seconds, what in ((0.0, 3.0, "sweep 1 of 2"), (150.0, 1.0, "sweep 2 of 2")):
            for k in range(11):
                done = (before + seconds * k / 10) / 200.0
                progress(Progress(done, (1 - done) * 200.0, what))
                self.now += seconds / 10 if k < 10 else 0.0
        progress.done()


@pytest.mark.parametrize("expected", [1 / 50, 1.0])
def test_the_seconds_left_are_true(expected: float) -> None:
    measurement = _Measurement(expected)
    measurement.run()
    first = measurement.said if expected < 1 else measurement.said[11:]  # until then a formula is all there is
    for left, said in first:
        assert said.seconds_left == pytest.approx(left, abs=0.1)
    measurement.said.clear()
    measurement.run()
    fractions = [said.fraction for _, said in measurement.said]
    assert fractions == sorted(fractions)
    for left, said in measurement.said:
        assert said.seconds_left == pytest.approx(left, abs=0.1)
        assert said.fraction == pytest.approx(1 - left / 4, abs=0.02)


def test_a_formula_that_says_nothing_is_passed_on() -> None:
    heard: list[Progress] = []
    Pace().corrected(0.0, heard.append)(Progress(0.5, 0.0, "played a file"))
    assert heard == [Progress(0.5, 0.0, "played a file")]
