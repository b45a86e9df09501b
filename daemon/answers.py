"""Fit results as the JSON object that `pzctl fit --json` prints."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ..fitters.interface import Budget, Constant, FitResult, Share


def number(value: float | None) -> float | None:
    """Return a number that JSON can hold: what is missing or infinite is null."""
    return value if value is not None and math.isfinite(value) else None


def constants_json(constants: Mapping[str, Constant]) -> dict[str, dict[str, Any]]:
    """Return constants, by name, as JSON objects."""
    return {
        name: {
            "re": number(constant.re),
            "im": number(constant.im),
            "u_re": number(constant.u_re),
            "u_im": number(constant.u_im),
            "unit": constant.unit,
            "free": constant.free,
            **_intervals(constant),
        }
        for name, constant in constants.items()
    }


def _intervals(constant: Constant) -> dict[str, Any]:
    """Return the intervals of a constant that has some: `interval` of its real, `interval_im` of its imaginary part."""
    parts = {"interval": constant.interval_re, "interval_im": constant.interval_im}
    return {name: {"68": list(i.p68), "95": list(i.p95)} for name, i in parts.items() if i is not None}


def _budget(budget: Budget) -> dict[str, Any]:
    def shares(part: Mapping[str, Share]) -> dict[str, Any]:
        return {name: {**asdict(share), "largest": list(share.largest)} for name, share in part.items()}

    return {"re": shares(budget.re), "im": shares(budget.im), "tolerances": dict(budget.tolerances)}


def fit_json(result: FitResult) -> dict[str, Any]:
    """Return a fit result as one JSON object, without the curves."""
    return {
        "build": result.build,
        "fitter": result.fitter,
        "version": result.version,
        "steps": list(result.steps),
        "noise": {"relative": number(result.noise.relative), "from": result.noise.source},
        "chi2_per_dof": number(result.chi2_per_dof),
        "constants": constants_json(result.constants),
        "derived": constants_json(result.derived),
        "correlation": [list(pair) for pair in result.correlation],
        "rms_log_error": number(result.rms_log_error),
        "converged": result.converged,
        "evaluations": result.evaluations,
        "seconds": result.seconds,
        "says": list(result.says),
        **({"budget": _budget(result.budget)} if result.budget is not None else {}),
    }
