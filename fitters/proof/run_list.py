"""The list of sealed runs: every one that was begun stands in it, finished or not, and all of them are pooled.

A run is entered when the hash of its truth is published, before anything is diagnosed, and completed when it is judged.
A run that was broken off stays in the list as what it is.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from .wilson import HitShare


@dataclass(frozen=True)
class SealedRun:
    """One sealed run."""

    world: str
    seed: int
    cases: int
    commit: str
    sha256: str
    date: str
    """UTC, to the minute, when it began."""
    shares: Mapping[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    """Hits and cases by figure; empty while it runs, and of one that was broken off."""
    seconds: float | None = None
    """Median for a case."""


def read_runs(path: Path) -> list[SealedRun]:
    """Return all runs of a list, the oldest first; none where there is no list yet."""
    if not path.exists():
        return []
    return [SealedRun(**one) for one in json.loads(path.read_text(encoding="utf-8"))]


def enter(path: Path, run: SealedRun) -> None:
    """Append a run that begins."""
    _write(path, [*read_runs(path), run])


def complete(path: Path, sha256: str, shares: Mapping[str, HitShare], seconds: float) -> None:
    """Fill in the figures of the last run entered with this hash."""
    runs = read_runs(path)
    last = max(k for k, run in enumerate(runs) if run.sha256 == sha256)
    runs[last] = replace(runs[last], shares={name: (one.hits, one.of) for name, one in shares.items()}, seconds=seconds)
    _write(path, runs)


def pooled(runs: Sequence[SealedRun], world: str) -> dict[str, HitShare]:
    """Return the figures of all finished runs of a world together."""
    total: dict[str, HitShare] = {}
    for run in runs:
        if run.world == world:
            for name, (hits, of) in run.shares.items():
                total[name] = total.get(name, HitShare(0, 0)) + HitShare(hits, of)
    return total


def _write(path: Path, runs: Sequence[SealedRun]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([asdict(run) for run in runs], indent=1) + "\n", encoding="utf-8")
