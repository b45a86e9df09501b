"""A comparison as the JSON object that `pzctl compare --json` prints: the form of a diagnosis."""

from collections.abc import Sequence
from typing import Any

import msgspec

from ....fitters.compare.comparison import ChangeFinding, Comparison
from ....fitters.compare.many import ManyCompared
from .fit_json import number

_NUMBERS = (
    "chi2_per_dof_before",
    "chi2_per_dof_after",
    "held_out_before",
    "held_out_after",
    "probability",
    "share",
    "moves",
)


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as one JSON object, without the curves; a missing or infinite number is null.

    It has every key of a diagnosis, with no `constants` and nothing that these could hide (`not_decidable`); `limits`
    says what may be there undetected.
    """
    return {
        "verdict": comparison.verdict,
        "probability": number(comparison.probability),
        "change": comparison.change,
        "described_by": msgspec.to_builtins(comparison.described_by),
        "baseline": {
            "chi2_per_dof": number(comparison.chi2_per_dof_before),
            "held_out": number(comparison.held_out_before),
            "constants": {},
        },
        "final": {
            "chi2_per_dof": number(comparison.chi2_per_dof_after),
            "held_out": number(comparison.held_out_after),
            "constants": {},
        },
        "findings": [_finding(one) for one in comparison.findings],
        "remarks": [_finding(one) for one in comparison.remarks],
        "remaining": msgspec.to_builtins(comparison.remaining),
        "not_decidable": [],
        "leftover": {
            "bands_Hz": msgspec.to_builtins(comparison.leftover_Hz),
            "chi2_per_dof": number(comparison.chi2_per_dof_after),
        },
        "limits": [msgspec.to_builtins(one) for one in comparison.limits],
        "repeatability": [msgspec.to_builtins(one) for one in comparison.repeatability],
        "resonances": [msgspec.to_builtins(one) for one in comparison.resonances],
        "held_out_Hz": msgspec.to_builtins(comparison.held_out_Hz),
        "says": list(comparison.says),
        "seconds": comparison.seconds,
    }


def many_json(found: ManyCompared, files: Sequence[str]) -> dict[str, Any]:
    """Return a comparison of several devices as one JSON object; `files` are those after, by device."""
    return {
        "devices": [{"file": file} | comparison_json(one) for file, one in zip(files, found.devices, strict=True)],
        "common": [msgspec.to_builtins(one) for one in found.common],
        "own": [[_finding(finding) for finding in findings] for findings in found.own],
        "outliers": [files[k] for k in found.outliers],
        "says": list(found.says),
    }


def _finding(finding: ChangeFinding) -> dict[str, Any]:
    made = msgspec.to_builtins(finding)
    return made | {name: number(made[name]) for name in _NUMBERS}
