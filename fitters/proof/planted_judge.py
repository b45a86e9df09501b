"""Answers to exact parts put onto real recordings, judged beside the answer to the recording as it is.

The device has causes of its own, which nobody knows: what is said of it counts neither as right nor as wrong. Judged is
what the part has added: whether it is named, and whether its size is what was planted, within 15 %, where the size that
is said of the recording as it is (nothing, where the effect is not said there) is taken off.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .lab_judge import SAID
from .wilson import HitShare, share

CLOSE = 0.15
"""Relative error of a size that is right."""


@dataclass(frozen=True)
class PlantedCase:
    """One recording with one part: its truth, the answer, and the answer to the recording as it is."""

    name: str
    truth: Mapping[str, Any]
    answer: Mapping[str, Any]
    bare: Mapping[str, Any]

    @property
    def named(self) -> bool:
        """Whether the part, or what no one could tell from it here, is said at its place."""
        return self._finding(self.answer) is not None

    @property
    def in_class(self) -> bool:
        """Whether it is named, or stands among the look-alikes of something that is."""
        return self.named or any(
            (other if isinstance(other, str) else other.get("effect")) in self._names
            for one in _said(self.answer)
            for other in one.get("same_as", [])
        )

    @property
    def size(self) -> float | None:
        """What is said of its size, less what is said of the recording as it is."""
        with_part = self._finding(self.answer)
        if with_part is None:
            return None
        value = self._size(with_part)
        before = self._finding(self.bare)
        own = self._size(before) if before is not None and before["effect"] == with_part["effect"] else 0.0
        return None if value is None else value - (own or 0.0)

    @property
    def right(self) -> bool:
        """Whether it is named with the right size."""
        return self.size is not None and abs(self.size / self.truth["size"] - 1) <= CLOSE

    @property
    def new_names(self) -> list[str]:
        """Effects said of the recording with the part that are neither it nor said of the recording as it is."""
        before = {one["effect"] for one in _said(self.bare)}
        allowed = before | self._names | {"unknown", "learned"}
        return [one["effect"] for one in _said(self.answer) if one["effect"] not in allowed]

    @property
    def _names(self) -> set[str]:
        return {self.truth["effect"], *self.truth["alike"]}

    def _finding(self, answer: Mapping[str, Any]) -> Mapping[str, Any] | None:
        fits = (one for one in _said(answer) if one["effect"] in self._names and one["where"] == self.truth["where"])
        return next(fits, None)

    def _size(self, finding: Mapping[str, Any]) -> float | None:
        names = {self.truth["effect"]: self.truth["parameter"], **self.truth["alike"]}
        said = finding.get("parameters", {}).get(names[finding["effect"]])
        return None if said is None else said.get("value")


def _said(answer: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [one for one in answer.get("findings", []) if float(one.get("probability") or 0.0) >= SAID]


def planted_figures(cases: Sequence[PlantedCase]) -> dict[str, HitShare]:
    """Return the figures of parts put onto real recordings."""
    return {
        "named, size within 15 %": share([case.right for case in cases]),
        "named": share([case.named for case in cases]),
        "named, or in the class of what is": share([case.in_class for case in cases]),
        "a name that is neither the part nor said without it": share([bool(case.new_names) for case in cases]),
    }
