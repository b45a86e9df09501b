"""Peaks equal those of SciPy, which is too slow to import for every fit and serves as the reference here."""

import subprocess
import sys

import numpy as np
import pytest

from pzctl.models.base.local_maxima import prominent_peaks


@pytest.mark.parametrize("steps", [None, 2, 0], ids=["rough", "with flat tops", "flat"])
@pytest.mark.parametrize("least", [0.0, 1.5, np.linspace(0.0, 4.0, 301)], ids=["all", "some", "by place"])
def test_peaks_are_those_of_scipy(steps: int | None, least: float | np.ndarray) -> None:
    from scipy.signal import find_peaks  # imported late: it takes half a second, in every process of a test run

    rng = np.random.default_rng(7)
    for _ in range(20):
        walk = np.cumsum(rng.normal(size=301))
        values = walk if steps is None else np.round(walk * steps) / 2
        expected, properties = find_peaks(values, prominence=least)
        found, prominences = prominent_peaks(values, least)
        assert found.tolist() == expected.tolist()
        assert prominences.tolist() == properties["prominences"].tolist()
        assert steps == 0 or found.size


@pytest.mark.parametrize("module", ["fitters.layered.mason", "daemon.report.json_output.experiment_json"])
def test_fits_and_diagnoses_start_without_the_slow_parts_of_scipy(module: str) -> None:
    slow = f"import sys, pzctl.{module}; print(*{{'scipy.signal', 'scipy.stats', 'matplotlib'}} & {{*sys.modules}})"
    assert subprocess.run([sys.executable, "-c", slow], capture_output=True, text=True, check=True).stdout == "\n"
