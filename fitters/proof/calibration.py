"""How honest probabilities are: log score and Brier score beside those of a constant, and the reliability diagram.

A skill of 0 is a constant's, 1 is knowing; the constant is the best there is in hindsight, the share that was right.
G. W. Brier, Mon. Weather Rev. 78 (1950) 1; I. J. Good, J. R. Stat. Soc. B 14 (1952) 107.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from .wilson import HitShare

_EDGES = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9)
_SUREST = 1e-4
"""Said probabilities nearer to 0 or 1 than this count as this: one case must not decide the log score alone."""


@dataclass(frozen=True)
class Calibration:
    """Scores of probabilities against what came true."""

    count: int
    right: float
    """Part that came true."""
    said: float
    """Mean probability."""
    log_score: float
    """Mean of -ln p(what came true), nats."""
    log_skill: float
    brier: float
    brier_skill: float


def calibration(pairs: Sequence[tuple[float, bool]]) -> Calibration:
    """Return the scores of (probability, came true); skills are nan where a constant is perfect."""
    n = len(pairs)
    if not n:
        return Calibration(0, *(math.nan,) * 6)
    base = sum(true for _, true in pairs) / n
    kept = [(min(max(p, _SUREST), 1 - _SUREST), true) for p, true in pairs]
    log = -sum(math.log(p if true else 1 - p) for p, true in kept) / n
    brier = sum((p - true) ** 2 for p, true in kept) / n
    entropy = -sum(b * math.log(b) for b in (base, 1 - base) if b)
    spread = base * (1 - base)
    return Calibration(
        count=n,
        right=base,
        said=sum(p for p, _ in pairs) / n,
        log_score=log,
        log_skill=1 - log / entropy if entropy else math.nan,
        brier=brier,
        brier_skill=1 - brier / spread if spread else math.nan,
    )


def reliability(pairs: Sequence[tuple[float, bool]]) -> list[tuple[float, HitShare]]:
    """Return mean probability said and share that came true, for each bin that is not empty."""
    rows: list[tuple[float, HitShare]] = []
    for low, high in pairwise(_EDGES):
        inside = [(p, true) for p, true in pairs if low <= p < high]
        if inside:
            rows.append((sum(p for p, _ in inside) / len(inside), HitShare(sum(t for _, t in inside), len(inside))))
    return rows


def draw_reliability(rows: Sequence[tuple[float, HitShare]], path: Path) -> None:
    """Draw share that came true over probability said; bars are Wilson's 95 % intervals, the diagonal is honest."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    drawing: Any = Figure(figsize=(5, 5), layout="constrained")
    FigureCanvasSVG(drawing)
    axes = drawing.subplots()
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    for p, part in rows:
        low, high = part.interval
        bars = [[max(part.value - low, 0)], [max(high - part.value, 0)]]
        axes.errorbar(p, part.value, yerr=bars, fmt="o", color="tab:blue", capsize=3)
        axes.annotate(str(part.of), (p, part.value), textcoords="offset points", xytext=(6, -10), fontsize="small")
    axes.set(xlabel="probability said", ylabel="part that was right", xlim=(0, 1.1), ylim=(-0.05, 1.1))
    drawing.savefig(path, metadata={"Date": None})
