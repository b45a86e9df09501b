"""Answers to the lab world's cases against their truth: every name said is right, alike, allowed, unnamed or wrong.

The rules, none of which knows a threshold of the diagnosis:

- *said* is a finding with a probability of `SAID` or more: more likely than not.
- A name is *right* that is planted and findable (or one of the truth's `accept`), at a place that counts.
- It is *alike* where it is not right but one of its merged class (`same_as`) is: reported apart.
- It is *allowed* where it is really there, but faint or an imperfection: it may be named and need not be.
- It is *unnamed* where it claims no cause: `unknown`, `learned`. It is right where nothing of a catalogue was planted.
- Everything else is *wrong*: also extra names beside right ones, also right names at wrong places.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

SAID, SURE = 0.5, 0.9
"""Probability from which a name counts as said, and as said for sure."""
DEVIATE = 1.96
"""Standard uncertainties of a 95 % interval."""
_UNNAMED = frozenset({"unknown", "learned"})
_NULL = frozenset({"instrument", "imperfect"})

Class = Literal["right", "alike", "allowed", "unnamed", "wrong"]


@dataclass(frozen=True)
class LabCase:
    """One case: its truth and what was answered (as `pzctl diagnose --json`, with `seconds`; or `error` alone)."""

    name: str
    truth: Mapping[str, Any]
    answer: Mapping[str, Any]

    @property
    def planted(self) -> Sequence[Mapping[str, Any]]:
        """What is there to be found, in the order of what it moves."""
        return self.truth["findings"]

    @property
    def failed(self) -> bool:
        """Whether there is no answer but an error."""
        return "error" in self.answer

    @property
    def findings(self) -> Sequence[Mapping[str, Any]]:
        """Findings said, in their order."""
        return [one for one in self.answer.get("findings", []) if _p(one) >= SAID]

    @property
    def classes(self) -> list[tuple[float, Class]]:
        """Probability and class of every finding said."""
        return [(_p(one), self.judge(one)) for one in self.findings]

    @property
    def is_null(self) -> bool:
        """Whether there is nothing to be found: instrument and imperfections only."""
        return not self.planted and self.truth["kind"] in _NULL

    @property
    def is_outside(self) -> bool:
        """Whether what dominates is in no catalogue."""
        return bool(self.planted) and self.planted[0]["effect"] == "unknown"

    @property
    def has_dominating(self) -> bool:
        """Whether one effect of the catalogue dominates."""
        return bool(self.planted) and self.planted[0].get("role") == "dominating" and not self.is_outside

    def judge(self, finding: Mapping[str, Any]) -> Class:
        """Return what a finding is."""
        if any(matches(finding, one) for one in self.planted):
            return "right"
        if finding["effect"] in _UNNAMED:
            return "unnamed"
        if any(matches(other, one) for other in _class_of(finding) for one in self.planted):
            return "alike"
        there = [*self.truth.get("faint", []), *self.truth.get("also", [])]
        return "allowed" if any(matches(finding, one) for one in there) else "wrong"

    def first_is_dominating(self, alike: bool) -> bool:
        """Return whether the first finding said is the dominating effect; `alike`: or its merged class holds it.

        A device's imperfection may stand before it if it truly moves more.
        """
        wanted = self.planted[0]
        larger = [one for one in self.truth.get("also", []) if one.get("moves", 0.0) >= wanted["moves"]]
        for said in self.findings:
            if matches(said, wanted) or (alike and any(matches(other, wanted) for other in _class_of(said))):
                return True
            if not any(matches(said, one) for one in larger):
                break
        return False

    @property
    def all_right(self) -> bool:
        """Whether something right or alike is said and nothing wrong."""
        classes = [one for _, one in self.classes]
        return "wrong" not in classes and ("right" in classes or "alike" in classes)

    @property
    def false_and_sure(self) -> bool:
        """Whether a wrong name is said for sure."""
        return any(one == "wrong" and p >= SURE for p, one in self.classes)

    @property
    def safe(self) -> bool:
        """Whether nothing wrong is said, and no `unexplained`: what a case without effects asks for."""
        wrong = any(one == "wrong" for _, one in self.classes)
        return not (self.failed or wrong or self.answer.get("verdict") == "unexplained")

    @property
    def found(self) -> list[bool]:
        """Of each planted effect of a catalogue: whether a finding names it."""
        return [
            any(matches(one, wanted) for one in self.findings)
            for wanted in self.planted
            if wanted["effect"] != "unknown"
        ]

    def covered(self, part: Literal["re", "im"]) -> list[bool]:
        """Return, for each true constant that has an answer with an uncertainty, whether its 95 % interval holds it."""
        found = self.answer.get("final", {}).get("constants", {})
        index, flags = ("re", "im").index(part), list[bool]()
        for name, true in self.truth["constants"].items():
            said = found.get(name)
            if said is None or (part == "im" and true[1] == 0.0):
                continue
            value, u = said.get(part), said.get(f"u_{part}")
            if value is not None and u:
                flags.append(abs(value - true[index]) <= DEVIATE * u)
        return flags

    @property
    def sizes(self) -> list[tuple[str, float]]:
        """Effect and (said over true) of every size of a right finding that the truth knows by the same name."""
        pairs: list[tuple[str, float]] = []
        for wanted in self.planted:
            for one in self.findings:
                if matches(one, wanted):
                    for name, said in one.get("parameters", {}).items():
                        true, value = wanted.get(name), said.get("value")
                        if isinstance(true, float) and true and isinstance(value, int | float):
                            pairs.append((wanted["effect"], value / true))
        return pairs


def matches(found: Mapping[str, Any], planted: Mapping[str, Any]) -> bool:
    """Return whether a finding names what was planted, at a place that counts as right.

    Another name that is as right may sit wherever that effect sits. A place `interface:A|` is any interface behind A.
    """
    if found["effect"] in planted.get("accept", ()):
        return True
    if found["effect"] != planted["effect"]:
        return False
    where = str(found.get("where", ""))
    return any(
        place in ("any", where) or (place.endswith("|") and where.startswith(place)) for place in planted["where"]
    )


def _class_of(finding: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the look-alikes that a finding says it cannot be told from; names alone stand for any place."""
    same: list[Mapping[str, Any]] = []
    for other in finding.get("same_as", []):
        one: Mapping[str, Any] = {"effect": other, "where": finding.get("where")} if isinstance(other, str) else other
        same.append(one)
    return same


def _p(finding: Mapping[str, Any]) -> float:
    return float(finding.get("probability") or 0.0)
