"""Which fits are followed by a diagnosis that nobody asked for."""

from collections.abc import Mapping
from typing import Any

SIGNIFICANT = 1.4
"""Misfit per degree of freedom; noise is known to some per cent, and 1600 residuals scatter by 3.5 %."""

DIAGNOSIS = "diagnosis"
"""Under this name a diagnosis is handed in, as a fit is under its fitter's."""

AUTO, ASKED = "auto", "asked"
"""What the setting `diagnose` may be: after every fit that leaves a mismatch, or only where it is asked for."""


def is_significant(chi2_per_dof: float, fitter: str, settings: Mapping[str, Any]) -> bool:
    """Return whether a daemon of these settings diagnoses what this fit leaves over.

    Only the first of its fitters gives rise to it: others may be coarse on purpose, as lumped circuits are.
    """
    fitters = settings.get("fitters") or ("",)
    return settings.get("diagnose") == AUTO and fitter == fitters[0] and chi2_per_dof > SIGNIFICANT
