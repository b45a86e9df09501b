"""How often `pzctl compare` is right: 200 pairs. Run by hand: `pytest tests/benchmarks/test_compare.py -s`.

It can also run in resumable parts, one line of a file per pair: `python tests/benchmarks/test_compare.py
results.jsonl SEED`; a further run with the same file continues and prints the table of the pairs so far. Developed on
seeds 1 to 3, 11, 101 and 102; the reported figures are those of seeds 2031 and 2032, of all pairs.
"""

import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from compare_bench import from_others
from compare_components import with_components
from compare_world import RECORDINGS, MadePair, at_terminals, in_device

from pzctl.fitters.compare.compare import compare
from pzctl.fitters.compare.comparison import Comparison

SEED = 2032


def wilson(hits: int, of: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share."""
    if of == 0:
        return 0.0, 1.0
    p = hits / of
    middle, half = p + z**2 / (2 * of), z * np.sqrt(p * (1 - p) / of + z**2 / (4 * of**2))
    return (middle - half) / (1 + z**2 / of), (middle + half) / (1 + z**2 / of)


def judged(pair: MadePair, found: Comparison) -> "Judgement":
    """Return whether a pair was named correctly, and its size is within 5 % and within 3 u (None: no such size)."""
    if not pair.effect:
        return found.verdict == "unchanged", None, None
    if pair.effect == "perhaps" and found.verdict == "unchanged":
        return True, None, None
    if pair.effect == "beyond the law":
        return found.verdict != "unchanged" and all(one.effect in pair.also for one in found.findings), None, None
    if pair.effect == "something else":
        honest = all(one.probability < 0.9 or one.effect in pair.also for one in found.findings)
        return found.verdict in ("unexplained", "partly-explained") and honest, None, None
    names = {pair.effect, *pair.also}
    for one in found.findings:
        called = {one.effect, *(other.effect for other in one.same_as)}
        if pair.effect in called or one.effect in names:
            sizes = [(one.parameters[name], true) for name, true in pair.sizes if name in one.parameters]
            if not sizes:
                return True, None, None
            # Either the capacitance or the inductance of a line is visible: the better known one counts.
            size, true = min(sizes, key=lambda pair: pair[0].u / abs(pair[0].value))
            off = abs(size.value - true)
            return len(found.findings) == 1, off < 0.05 * abs(true), off < 3 * size.u + 1e-3 * abs(true)
    return False, None, None


Judgement = tuple[bool, bool | None, bool | None]


def compared(pair: MadePair) -> tuple[Judgement, float]:
    """Compare a pair, print wrong findings, and return the judgement and the seconds."""
    found = compare([pair.before], [pair.after])
    judgement = judged(pair, found)
    if not all(part in (True, None) for part in judgement):
        named = [
            (
                f"{one.effect}{' gone' if one.removed else ''} {one.probability:.2f}",
                {name: f"{size.value:.4g}({size.u:.1g})" for name, size in one.parameters.items()},
                [other.effect for other in one.same_as],
            )
            for one in found.findings
        ]
        print(
            f"{judgement} {pair.name}: {pair.effect or 'nothing'} {'gone ' if pair.removed else ''}{pair.sizes}; "
            f"{found.verdict} {found.probability:.3f} {named} change {found.change:.2g} "
            f"left {found.remaining.total:.2g} {found.seconds:.1f} s",
            flush=True,
        )
    return judgement, found.seconds


def run(pairs: Iterable[MadePair]) -> dict[str, list[Judgement]]:
    """Compare all, and return the judgements by effect."""
    results: dict[str, list[Judgement]] = {}
    for pair in pairs:
        results.setdefault(pair.effect or "unchanged", []).append(compared(pair)[0])
    return results


def every_pair(seed: int) -> Iterator[tuple[str, MadePair]]:
    """Yield the pairs of all worlds with the names of these, in turns: of every second recording, two."""
    worlds = {
        "recordings": [pair for k, pair in enumerate(at_terminals(seed, 1)) if k // 2 % 2 == 0],
        "resonators": list(in_device(seed, 12)),
        "others": list(from_others(seed, 1)),
        "components": list(with_components(seed, 2)),
    }
    placed = [(k / len(own), world, pair) for world, own in worlds.items() for k, pair in enumerate(own)]
    yield from ((world, pair) for _, world, pair in sorted(placed, key=lambda one: one[:2]))


def in_the_background(results: Path, seed: int) -> None:
    """Compare the pairs without a line in the file, and print the table of each world."""
    lines = results.read_text().splitlines() if results.exists() else []
    with results.open("a") as file:
        for world, pair in list(every_pair(seed))[len(lines) :]:
            judgement, seconds = compared(pair)
            told = [None if part is None else bool(part) for part in judgement]
            lines.append(json.dumps([world, pair.effect or "unchanged", told, seconds]))
            print(lines[-1], file=file, flush=True)
    every = [json.loads(line) for line in lines]
    for world in dict.fromkeys(one[0] for one in every):
        print(world)
        own: dict[str, list[Judgement]] = {}
        for _, effect, judgement, _ in (one for one in every if one[0] == world):
            own.setdefault(effect, []).append(judgement)
        table(own)


def table(results: dict[str, list[Judgement]]) -> tuple[int, int]:
    """Print the figures; return the number of correctly named changed pairs, and their total."""
    every = [one for effect, own in results.items() if effect != "unchanged" for one in own]
    for effect, own in [*sorted(results.items()), ("all changed", every)]:
        right = sum(one[0] for one in own)
        low, high = wilson(right, len(own))
        sized = [one[1] for one in own if one[1] is not None]
        inside = [one[2] for one in own if one[2] is not None]
        print(
            f"{effect:20s} right {right}/{len(own)} [{low:.3f}, {high:.3f}]; size within 5 % "
            f"{sum(sized)}/{len(sized)}; within 3 u {sum(inside)}/{len(inside)}",
            flush=True,
        )
    return sum(one[0] for one in every), len(every)


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason=f"the real recordings are not at {RECORDINGS}")
def test_elements_at_the_terminals_of_real_recordings_are_named_with_their_size() -> None:
    results = run(at_terminals(SEED, 2))
    right, of = table(results)
    assert right >= 0.95 * of
    assert sum(one[0] for one in results["unchanged"]) >= 0.99 * len(results["unchanged"]) - 1


def test_changes_in_a_device_are_named_with_their_size() -> None:
    results = run(in_device(SEED, 30))
    right, of = table(results)
    assert right >= 0.95 * of


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason=f"the recordings of coils are not at {RECORDINGS}")
def test_pairs_with_real_components() -> None:
    right, of = table(run(with_components(SEED, 2)))
    assert right >= 0.9 * of


def test_pairs_of_another_laboratory() -> None:
    results = run(from_others(SEED))
    right, of = table(results)
    assert right >= 0.9 * of
    assert sum(one[0] for one in results["unchanged"]) >= 0.99 * len(results["unchanged"]) - 1


if __name__ == "__main__":
    in_the_background(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else SEED)
