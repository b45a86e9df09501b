"""Swapped recordings of two steps are named, within seconds, and a fit that ends nowhere says where."""

from collections.abc import Callable

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.engine import multi_step_fit
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.stack import StackError
from pzctl.models.sweep import Sweep

F = np.linspace(1e6, 6e6, 201)
BUILD = read_build(THESIS_BUILD)
STEPS = ("disk", "ml1", "ml2")


@pytest.fixture
def of_steps(swept: Callable[..., Sweep]) -> dict[str, tuple[Sweep, ...]]:
    return {name: (swept(stack_of(BUILD, BUILD.step(name)), F, seed=k),) for k, name in enumerate(STEPS)}


@pytest.mark.long
@pytest.mark.parametrize(("one", "other"), [("disk", "ml1"), ("ml1", "ml2")])
def test_swapped_recordings_are_named(of_steps: dict[str, tuple[Sweep, ...]], one: str, other: str) -> None:
    swapped = {**of_steps, one: of_steps[other], other: of_steps[one]}
    with pytest.raises(FitError, match=rf"'{one}' \(sweep\) and '{other}' \(sweep\) seem to be swapped"):
        Mason().fit(FitTask(BUILD, swapped))


def test_a_recording_of_another_step_is_not_swapped_with_one_that_is_right(
    of_steps: dict[str, tuple[Sweep, ...]],
) -> None:
    result = Mason().fit(FitTask(BUILD, {"disk": of_steps["ml1"]}))
    assert result.rms_log_error > 0.2


def test_a_fit_that_ends_where_there_is_no_device_says_so(
    of_steps: dict[str, tuple[Sweep, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def vanish(*_: object) -> None:
        raise StackError("layer 'glue1': thickness is 0; a positive finite number is needed")

    monkeypatch.setattr(multi_step_fit, "_best_descent", vanish)
    with pytest.raises(FitError, match=r"the fit of step 'disk' ended where .* \(layer 'glue1': thickness is 0; .*\)"):
        Mason().fit(FitTask(BUILD, {"disk": of_steps["disk"]}))
