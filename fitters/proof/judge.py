"""Diagnoses judged against sealed truths: what was right and what was not."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...models.base.errors import CannotError

DETECTABLE = 60.0
"""chi2 that an effect of the ideal world must bring to count as detectable: by chance noise brings so much to one of a
thousand names, places and shapes of four sizes each in 3 of 10^9 recordings."""
TOLD = "told.json"
"""What a diagnosis answers that is told which effects are there."""


class ProofError(CannotError):
    """A proof that is none."""


@dataclass(frozen=True)
class Judged:
    """One case: what was hidden, what was answered."""

    name: str
    truth: Mapping[str, Any]
    answer: Mapping[str, Any]
    """As of `pzctl diagnose --json`, with `seconds`; or with `error` alone."""
    told: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """The same of a diagnosis that was told which effects are there; empty where none was."""

    @property
    def kind(self) -> str:
        """`none`, `one`, `two`, `outside`, `absorbed`, or `faint`: an effect that is not detectable."""
        gains = [planted["gain"] for planted in self.truth["findings"]]
        return "faint" if gains and min(gains) < DETECTABLE else self.truth["kind"]

    @property
    def findings(self) -> Sequence[Mapping[str, Any]]:
        """What was found."""
        return self.answer.get("findings", [])

    @property
    def right(self) -> bool:
        """Whether the answer is what the kind of case asks for."""
        planted = self.truth["findings"]
        if "error" in self.answer:
            return False
        if self.kind in ("none", "absorbed"):
            return not self.findings
        if self.kind == "one":
            return bool(self.findings) and is_right(self.findings[0], planted[0])
        if self.kind == "two":
            return all(any(is_right(found, one) for found in self.findings) for one in planted)
        if self.kind == "outside":
            return bool(self.findings) and all(is_right(found, planted[0]) for found in self.findings)
        return all(any(is_right(found, one) for one in planted) for found in self.findings)

    @property
    def right_in_group(self) -> bool:
        """Whether the first finding or one of those it is not told apart from is right."""
        if self.right or not self.findings or not self.truth["findings"]:
            return self.right
        first, planted = self.findings[0], self.truth["findings"][0]
        return any(is_right(one, planted) for one in (first, *first["alternatives"]))

    @property
    def listed(self) -> bool:
        """Whether every absorbed effect of the catalogue is listed as not decidable."""
        said = {entry["effect"] for entry in self.answer.get("not_decidable", [])}
        return set(self.truth["not_decidable"]) <= said

    def error_of_constants(self, side: str) -> float | None:
        """Return the relative error of the constants of the `baseline` or `final` fit, root of the mean square."""
        errors = [
            abs(complex(found["re"], found["im"] or 0.0) / complex(*true) - 1) ** 2 for found, true in self._known(side)
        ]
        return (sum(errors) / len(errors)) ** 0.5 if errors else None

    def deviation_of_constants(self, side: str) -> float | None:
        """Return the errors of these constants in their own stated uncertainties, root of the mean square."""
        far = [
            ((found[part] - wanted) / uncertainty) ** 2
            for found, true in self._known(side)
            for part, wanted in zip(("re", "im"), true, strict=True)
            if (uncertainty := found[f"u_{part}"])
        ]
        return (sum(far) / len(far)) ** 0.5 if far else None

    def _known(self, side: str) -> list[tuple[dict[str, Any], list[float]]]:
        """Return each constant of the materials as it was found, and its true parts."""
        found = self.answer.get(side, {}).get("constants", {})
        return [
            (found[name], true)
            for name, true in self.truth["constants"].items()
            if name in found and name.split(".")[1] in ("c33D", "h33", "eps33S", "z", "c")
        ]


def is_right(found: Mapping[str, Any], planted: Mapping[str, Any]) -> bool:
    """Return whether a finding names what was planted, at a place that counts as right."""
    if found["effect"] not in (planted["effect"], *planted["accept"]):
        return False
    where: str = found["where"]
    return found["effect"] in planted["accept"] or any(
        place in ("any", where) or (place.endswith("|") and where.startswith(place)) for place in planted["where"]
    )


def read_judged(folder: Path, published: str) -> tuple[Judged, ...]:
    """Read truth and answers of a proof. A case without answer counts as not right.

    Raises ProofError where the truth is not the one whose hash was published.
    """
    truths = read_sealed(folder, published)
    answers = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    told: dict[str, Any] = json.loads((folder / TOLD).read_text(encoding="utf-8")) if (folder / TOLD).exists() else {}
    missing = {"error": "no answer"}
    return tuple(Judged(name, truth, answers.get(name, missing), told.get(name, {})) for name, truth in truths.items())


def read_sealed(folder: Path, published: str) -> dict[str, Any]:
    """Return the truth of all cases by name. Raises ProofError where it is not the one whose hash was published."""
    data = (folder / "truth.json").read_bytes()
    found = hashlib.sha256(data).hexdigest()
    if found != published:
        raise ProofError(f"{folder / 'truth.json'}: its SHA-256 is {found}, published was {published}; it was changed")
    return json.loads(data)
