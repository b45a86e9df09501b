"""Fit results as the JSON object that `pzctl fit --json` prints, which is also the one on the wire."""

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from ....fitters.interface import Constant, FitResult
from ....fitters.population.conformity import judged
from ....models.build import Build
from ...wire.frames import to_json
from ...wire.result_messages import report_of


def number(value: float | None) -> float | None:
    """Return the number, or None (null in JSON) if it is missing or not finite."""
    return value if value is not None and math.isfinite(value) else None


def constants_json(constants: Mapping[str, Constant]) -> dict[str, dict[str, Any]]:
    """Return constants, by name, as JSON objects."""
    return _plain(constants)


def fit_json(result: FitResult, build: Build | None = None) -> dict[str, Any]:
    """Return a fit result as one JSON object, without the curves; with `verdict` if the build has limits."""
    verdict = judged(result, build)
    return _plain(report_of(result)) | ({"verdict": _plain(verdict)} if verdict else {})


def _plain(value: Any) -> Any:
    """Return a value as plain data, as a reader of its JSON gets it."""
    return msgspec.json.decode(to_json(value))
