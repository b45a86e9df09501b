"""Which fits the daemon diagnoses without a request."""

from collections.abc import Mapping
from typing import Any

SIGNIFICANT = 1.4
"""chi2/dof above which a misfit is significant; the noise is known to a few per cent, and the chi2/dof of 1600
residuals scatters by 3.5 %."""

DIAGNOSIS = "diagnosis"
"""The name under which diagnoses are submitted, in place of a fitter's name."""

AUTO, ASKED = "auto", "asked"
"""Values of the setting `diagnose`: after every fit with a significant misfit, or only on request."""


def is_significant(chi2_per_dof: float, fitter: str, settings: Mapping[str, Any]) -> bool:
    """Return whether a daemon with these settings diagnoses this fit by itself.

    Only fits of its first fitter are diagnosed: others may be coarse on purpose, such as lumped circuits.
    """
    fitters = settings.get("fitters") or ("",)
    return settings.get("diagnose") == AUTO and fitter == fitters[0] and chi2_per_dof > SIGNIFICANT
