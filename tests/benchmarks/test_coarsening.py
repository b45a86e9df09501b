"""How much evidence is one nat beside errors: probabilities of all effects, by both constants of the coarsening.

A score of the names said alone would favour whatever says little. Here every effect of the catalogue counts: for one
that was planted and can be found, ln of its probability; for one that is not there, ln of what is left of it. Faint
effects and imperfections may be named and need not be.

Run by hand, in resumable parts, one line of a file per case of the laboratory's world:
`python tests/benchmarks/test_coarsening.py results.jsonl 601 24` looks for the effects of 24 cases of seed 601; a
further run with the same file and another seed adds its cases.
"""

import json
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pzctl.daemon.samples.sample_selection import folder_sample
from pzctl.fitters.diagnosis.data_quality.data_gates import gate
from pzctl.fitters.diagnosis.decision_rules import APPROXIMATE, COARSENED, NAMED, UNFORESEEN
from pzctl.fitters.diagnosis.hypotheses import hypothesis
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates, flaws
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.search.greedy_search import GreedySearch
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.proof.lab_judge import LabCase, matches
from pzctl.sim.blind_cases.lab.files import make_case

GRID = (
    *((nats, COARSENED) for nats in (0.0, 2.0, 4.0, 8.0, APPROXIMATE, 24.0)),
    *((APPROXIMATE, share) for share in (0.02, 0.1)),
)
"""Both constants; the rule's own are among them."""
LEAST = 0.01
"""Probability below which nothing counts as more improbable: a search that has not tried an effect says zero."""
SURE = 0.84
"""What the reserve of one in seven leaves of certainty."""


@contextmanager
def constants(nats: float, share: float) -> Iterator[None]:
    """Decide with these constants for a while."""
    kept = hypothesis.APPROXIMATE, hypothesis.COARSENED
    hypothesis.APPROXIMATE, hypothesis.COARSENED = nats, share
    try:
        yield
    finally:
        hypothesis.APPROXIMATE, hypothesis.COARSENED = kept


def looked_for(task: FitTask) -> list[list[list[Any]]]:
    """Return effect, place and probability of all effects of a complete search, for each pair of the grid.

    A disk of finite diameter is looked at as a plate.
    """
    task = replace(task, sweeps=gate(task.sweeps).sweeps)
    problem = Problem.posed(task, lambda _: None, None, "bands")
    search = GreedySearch(problem, (*candidates(problem), *flaws(problem)))
    search.begin()
    search.run()
    told: list[list[list[Any]]] = []
    for pair in GRID:
        with constants(*pair):
            reserve = 1.0 if search.best.fit.exact else 1 - UNFORESEEN
            found: dict[tuple[str, str], float] = {}
            for one, part in search.posterior:
                for its in {(effect.effect.name, effect.where) for effect in one.effects}:
                    found[its] = found.get(its, 0.0) + reserve * part
            told.append([[*its, part] for its, part in found.items()])
    return told


def ran(seed: int, index: int) -> dict[str, Any]:
    """Look for the effects of one case; return its truth and what was told, as plain data."""
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        truth = make_case(Path(folder), seed, index)
        job = folder_sample(Path(folder) / truth["name"]).job
        assert job is not None, truth["name"]
        try:
            told = looked_for(job.task)
        except FitError:
            told = [[] for _ in GRID]
    return {"seed": seed, "index": index, "truth": truth, "told": told, "seconds": time.process_time() - began}


def scored(case: Mapping[str, Any], k: int) -> tuple[float, dict[str, int]]:
    """Return the score of a case with one pair of the grid, nats, and how many names of each kind it says."""
    truth = LabCase(case["truth"]["name"], case["truth"], {})
    best: dict[str, tuple[float, dict[str, Any]]] = {}
    for effect, where, part in case["told"][k]:  # the likeliest place stands for an effect
        if effect not in best or part > best[effect][0]:
            best[effect] = part, {"effect": effect, "where": where}
    total, said = 0.0, {"right": 0, "wrong": 0, "sure": 0}
    for planted in truth.planted:
        if planted["effect"] != "unknown":
            most = max((part for part, one in best.values() if matches(one, planted)), default=0.0)
            total -= float(np.log(max(most, LEAST)))
            said["right"] += most >= NAMED
    for part, one in best.values():
        if truth.judge(one) == "wrong":
            total -= float(np.log(max(1 - part, LEAST)))
            said["wrong"] += part >= NAMED
            said["sure"] += part >= SURE
    return total, said


def table(cases: list[dict[str, Any]]) -> str:
    """Return score and names for each pair of constants, summed over all cases."""
    findable = sum(one["effect"] != "unknown" for case in cases for one in case["truth"]["findings"])
    lines = [f"{len(cases)} cases, {findable} effects to be found", "nats  share   score, nats  right  wrong  for sure"]
    for k, (nats, share) in enumerate(GRID):
        scores = [scored(case, k) for case in cases]
        right, wrong, sure = (sum(said[kind] for _, said in scores) for kind in ("right", "wrong", "sure"))
        lines.append(f"{nats:4g}{share:7g}{sum(score for score, _ in scores):14.1f}{right:7d}{wrong:7d}{sure:10d}")
    return "\n".join(lines)


def test_a_search_is_scored_with_the_rules_own_constants() -> None:
    """One case in full; the table is made by hand, for a case takes half a minute."""
    case = ran(601, 1)
    print(table([case]))
    score, said = scored(case, GRID.index((APPROXIMATE, COARSENED)))
    assert said["right"] == 1, said
    assert score < 1, score


def main(file: Path, seed: int, count: int) -> None:
    """Look for the effects of the cases that the file does not have yet, and print the table of all."""
    lines = file.read_text().splitlines() if file.exists() else []
    made = {(one["seed"], one["index"]): one for one in map(json.loads, lines)}
    for index in range(count):
        if (seed, index) not in made:
            made[seed, index] = ran(seed, index)
            with file.open("a") as out:
                out.write(json.dumps(made[seed, index]) + "\n")
    print(table(list(made.values())))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
