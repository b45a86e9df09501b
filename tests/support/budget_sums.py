"""What the parts of an uncertainty budget add up to."""

import numpy as np
import pytest

from pzctl.fitters.interface import FitResult


def assert_the_budget_adds_up(result: FitResult) -> None:
    """Assert that the parts of every real part's uncertainty, but for assumptions, are all of it."""
    assert result.budget is not None
    assert result.budget.re
    for name, share in result.budget.re.items():
        own = result.constants.get(name)
        if own is not None and own.u_re:
            parts = [share.noise, share.instrument, share.model, share.dimensions, share.knowledge]
            assert np.linalg.norm(parts) == pytest.approx(own.u_re, rel=1e-3), name
