"""Whether a comparison is right, judged strictly, and the table of many.

Right is a changed pair if its change is the only finding of a probability of one half or more, named by its own name
or by one that the comparison itself says it cannot distinguish from it, and inserted or removed as it was.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from compare_world import MadePair

from pzctl.fitters.compare.comparison import ChangeFinding, Comparison

_COUNTS = 0.5
"""Smallest probability of a finding that counts."""


@dataclass(frozen=True)
class Judgement:
    """Whether a pair was named correctly, and its size is within 5 % and within 3 u; None: there is no such size."""

    right: bool
    within_5_percent: bool | None = None
    within_3_u: bool | None = None


def judged(pair: MadePair, found: Comparison) -> Judgement:
    """Return the judgement of a pair's comparison."""
    findings = [one for one in found.findings if one.probability >= _COUNTS]
    if not pair.effect or (pair.effect == "perhaps" and found.verdict == "unchanged"):
        return Judgement(found.verdict == "unchanged")
    if pair.effect == "something else":
        honest = all(one.effect in pair.also for one in findings)
        return Judgement(found.verdict in ("unexplained", "partly-explained") and honest)
    if pair.effect == "beyond the law" and not findings:
        return Judgement(found.verdict in ("unexplained", "partly-explained"))
    if len(findings) != 1 or not _named(pair, findings[0]):
        return Judgement(False)
    sizes = [(findings[0].parameters[name], true) for name, true in pair.sizes if name in findings[0].parameters]
    if not sizes or pair.effect == "beyond the law":
        return Judgement(True)
    # Either the capacitance or the inductance of a line is visible: the better known one counts.
    size, true = min(sizes, key=lambda one: one[0].u / abs(one[0].value))
    off = abs(size.value - true)
    return Judgement(True, bool(off < 0.05 * abs(true)), bool(off < 3 * size.u))


def _named(pair: MadePair, finding: ChangeFinding) -> bool:
    called = {finding.effect, *(other.effect for other in finding.same_as)}
    vague = pair.effect in ("perhaps", "beyond the law")
    return bool(called & set(pair.also) if vague else pair.effect in called) and finding.removed == pair.removed


def line_of(world: str, pair: MadePair, found: Comparison, seconds: float) -> dict[str, Any]:
    """Return what is kept of a pair: its truth, what was said, the judgement and the processor's seconds."""
    return {
        "world": world,
        "pair": pair.name,
        "effect": pair.effect or "unchanged",
        "removed": pair.removed,
        "sizes": dict(pair.sizes),
        **asdict(judged(pair, found)),
        "verdict": found.verdict,
        "probability": found.probability,
        "findings": [
            {
                "effect": one.effect,
                "removed": one.removed,
                "probability": one.probability,
                "same_as": [other.effect for other in one.same_as],
                "sizes": {name: [size.value, size.u] for name, size in one.parameters.items()},
            }
            for one in found.findings
        ],
        "change": found.change,
        "left": found.remaining.total,
        "seconds": seconds,
    }


def wilson(hits: int, of: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share."""
    if of == 0:
        return 0.0, 1.0
    p = hits / of
    middle, half = p + z**2 / (2 * of), z * math.sqrt(p * (1 - p) / of + z**2 / (4 * of**2))
    return (middle - half) / (1 + z**2 / of), (middle + half) / (1 + z**2 / of)


def table(lines: Sequence[dict[str, Any]]) -> None:
    """Print the figures of every effect, of all changed pairs, and the processor's seconds."""
    changed = [one for one in lines if one["effect"] != "unchanged"]
    for effect in sorted({one["effect"] for one in lines}):
        _row(effect, [one for one in lines if one["effect"] == effect])
    _row("all changed", changed)
    seconds = sorted(one["seconds"] for one in lines)
    if seconds:
        mean = sum(seconds) / len(seconds)
        print(f"processor seconds: median {seconds[len(seconds) // 2]:.2f}, mean {mean:.2f}, most {seconds[-1]:.1f}")


def _row(name: str, own: Sequence[dict[str, Any]]) -> None:
    parts = (
        _share("right", (one["right"] for one in own)),
        _share("size within 5 %", (one["within_5_percent"] for one in own)),
        _share("within 3 u", (one["within_3_u"] for one in own)),
    )
    print(f"{name:20s} {'; '.join(parts)}", flush=True)


def _share(name: str, told: Iterable[bool | None]) -> str:
    known = [one for one in told if one is not None]
    low, high = wilson(sum(known), len(known))
    return f"{name} {sum(known)}/{len(known)} [{low:.2f}, {high:.2f}]"
