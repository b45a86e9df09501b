"""Error sentences for values that models refuse: what, where, what was found, what is allowed."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pzctl.models.base.errors import PzctlError
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.stack import AIR, Elastic, HalfSpace, Piezo
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import Segment, SweepPlan

DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 0j, 8.09e-9 * (1 - 0.017j))
GLUE = Elastic("x.glue", 10e-6, 2.9e6, 2550.0, 30.0)


def swept(f: list[float], size: int) -> Sweep:
    return Sweep(np.array(f), np.ones(size, complex), id="a.csv")


@pytest.mark.parametrize(
    ("work", "says"),
    [
        (
            lambda: swept([1e6, 2e6], 3),
            "recording 'a.csv': frequency has shape (2,) and impedance (3,); both must be (N,)",
        ),
        (
            lambda: swept([0.0, 1e6], 2),
            "recording 'a.csv': frequency of point 1 is 0 Hz; only positive frequencies are allowed",
        ),
        (
            lambda: swept([1e6, 2e6, 2e6], 3),
            "recording 'a.csv': frequency of point 3 (2000000 Hz) equals that of point 2 (2000000 Hz); "
            "frequencies must rise strictly",
        ),
        (
            lambda: HalfSpace("backing", -1.0),
            "load 'backing': z is -1 Rayl; allowed is zero or a positive finite number",
        ),
        (
            lambda: (AIR | GLUE | DISK | AIR).with_area(1e-4),
            "stack: a layer is called 'x.glue'; a name has no dot and is none of ('area', 'back', 'front')",
        ),
        (
            lambda: (AIR | DISK | AIR | GLUE | AIR).with_area(1e-4),
            "stack: a load stands between two layers; loads stand at the ends only",
        ),
        (lambda: swept([1e6], 1), "recording 'a.csv': 1 point(s) found; at least 2 are needed"),
        (
            lambda: swept([1e6, float("nan")], 2),
            "recording 'a.csv': frequency of point 2 is nan; only finite numbers allowed",
        ),
        (lambda: Segment(-1.0, 1e6), "segment: start is -1 Hz; a positive frequency is needed"),
        (lambda: SweepPlan(()), "sweep plan: no segment; at least one is needed"),
        (lambda: replace(DISK, polarity=2), "layer 'disk': polarity is 2; allowed is 1 or -1"),
        (lambda: Lumped(C0=-1e-9), "equivalent circuit: C0 is -1e-09; a positive number is needed"),
        (
            lambda: Lumped(1e-9, (Branch(float("nan"), 1e-4, 1e-11),)),
            "equivalent circuit: branch1.R is nan; a finite number is needed",
        ),
    ],
)
def test_what_no_model_takes(work: Callable[[], object], says: str) -> None:
    with pytest.raises(PzctlError) as caught:
        work()
    assert str(caught.value) == says
