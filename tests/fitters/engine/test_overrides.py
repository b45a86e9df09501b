"""Constants held, tied, bounded or given priors for one fit; and error sentences."""

from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import read_build
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.engine.parameters.overrides import Amendments, amended
from pzctl.fitters.interface import FitError, FitResult, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.build import Build


@pytest.fixture
def build(cases: Path) -> Build:
    return read_build(cases / "glue-null" / "build.toml")


def fit(cases: Path, build: Build, wanted: Amendments) -> FitResult:
    sweeps = {step: (read_recording(cases / "glue-null" / f"{step}.csv"),) for step in ("disk", "ml1")}
    return Mason().fit(FitTask(amended(build, wanted), sweeps))


def test_held_constants_stay_and_tied_constants_are_equal(cases: Path, build: Build) -> None:
    wanted = Amendments(hold=("disk.density",), tie=(("glue1.q", "ml1.q"),))
    result = fit(cases, build, wanted)
    assert result.constants["disk.density"].u_re == 0
    assert result.constants["disk.density"].re == pytest.approx(build.layer("disk").values["density"].re, rel=1e-12)
    assert result.constants["glue1.q"].re == result.constants["ml1.q"].re
    assert result.constants["glue1.q"].u_re == result.constants["ml1.q"].u_re != 0


def test_constants_stay_within_their_bounds(cases: Path, build: Build) -> None:
    free = fit(cases, build, Amendments()).constants["ml1.c"].re
    wanted = Amendments(bound=(("ml1.c", free * 1.01, free * 1.2),))
    assert free * 1.01 <= fit(cases, build, wanted).constants["ml1.c"].re <= free * 1.2


def test_a_narrow_prior_wins_where_the_recording_tells_little(cases: Path, build: Build) -> None:
    thickness = fit(cases, build, Amendments(prior=(("ml1.thickness", 2.23e-4, 1e-9),))).constants["ml1.thickness"]
    assert abs(thickness.re - 2.23e-4) < 3e-9
    loss = amended(build, Amendments(prior=(("disk.eps33S.loss", 0.02, 0.001),))).layer("disk").values["eps33S"]
    np.testing.assert_allclose([loss.im, loss.u_im], [-0.02 * loss.re, 0.001 * loss.re])


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        (Amendments(hold=("ml1.x",)), "cannot hold 'ml1.x': this build has area, back.z"),
        (Amendments(tie=(("ml1.z", "glue1.c"),)), "two of one kind are needed"),
        (Amendments(tie=(("ml1.z", "ml1.z"),)), "two of one kind are needed"),
        (Amendments(tie=(("ml1.z", "glue9.z"),)), "cannot tie 'ml1.z' to 'glue9.z': this build has"),
        (Amendments(tie=(("ml1.z", "glue1.z"), ("glue1.z", "ml1.z"))), "tied already"),
        (Amendments(tie=(("back.z", "front.z"),)), "loads cannot be tied"),
        (Amendments(prior=(("ml1.z", 1e7, 0.0),)), "its uncertainty is 0; a positive one is needed"),
        (Amendments(prior=(("ml1.z", -1e7, 1.0),)), "a positive number is needed"),
        (Amendments(prior=(("disk.h33.loss", 0.1, 0.1),)), "only c33D and eps33S"),
        (Amendments(bound=(("ml1.z", 1e5, 2e5),)), "is not between 100000 and 200000"),
        (Amendments(bound=(("ml1.z", -1.0, 2e8),)), "its lowest value is positive"),
    ],
)
def test_what_cannot_be_is_one_sentence(build: Build, wanted: Amendments, sentence: str) -> None:
    with pytest.raises(FitError) as caught:
        amended(build, wanted)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
