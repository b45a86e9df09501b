"""Whether the formulas of effects describe what was planted: fits of the planted effects, one after the other.

No search: each effect is fitted at its place from what the screening promises beside those before. What is then missing
beside errors of a good device and instrument is due to a formula, to a fit that did not arrive, or to weak lines, which
are not looked for here. A formula that is off hides every further effect (opened seed 1024, lab-015: a backing whose
speed of sound did not depend on frequency was 6000 nats short beside a bond layer; with its dispersion 6).

Run by hand: `python tests/benchmarks/test_planted_fits.py 601 24` prints a line for each case of seed 601.
"""

import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pzctl.daemon.samples.sample_selection import folder_sample
from pzctl.fitters.diagnosis.data_quality.data_gates import gate
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates, flaws
from pzctl.fitters.diagnosis.hypotheses.condensed_recordings import condensed
from pzctl.fitters.diagnosis.hypotheses.hypothesis import Hypothesis, beside, fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.search.screening import screened
from pzctl.fitters.error_model.error_sizes import ErrorSizes
from pzctl.fitters.interface import UNCOMPUTABLE, FitTask
from pzctl.fitters.proof.lab_judge import matches
from pzctl.sim.blind_cases.lab.files import make_case

_PROMISES = 3
"""Number of starts that are tried for each effect."""


def places_of(problem: Problem, planted: Mapping[str, Any]) -> tuple[Candidate, ...]:
    """Return the candidates that are right for what was planted; those in all its steps, if there are any."""
    own = [
        one
        for one in (*candidates(problem), *flaws(problem))
        if matches({"effect": one.effect.name, "where": one.where}, planted)
    ]
    return tuple(one for one in own if one.steps == problem.steps or planted["step"] in one.steps) or tuple(own)


def with_one_more(problem: Problem, parent: Hypothesis, own: tuple[Candidate, ...]) -> Hypothesis | None:
    """Return the best fit with one of these effects more, from near the parent and from plain least squares."""
    best: Hypothesis | None = None
    for promise in screened(problem, parent, beside(parent.effects, own))[0][:_PROMISES]:
        effects, values = (*parent.effects, promise.candidate), {**parent.values, **promise.start}
        sizes = parent.fit.sizes, ErrorSizes(colour=parent.fit.sizes.colour)
        for near in (True, False):
            about = parent.fit.minimum.corrections if near else None
            try:
                made = fitted(problem, effects, values, sizes, near=near, rounds=4, about=about)
            except UNCOMPUTABLE:
                continue
            if best is None or made.log_weight > best.log_weight:
                best = made
    return best


def planted_fits(task: FitTask, truth: Mapping[str, Any]) -> Iterator[Hypothesis]:
    """Yield the fit without effects, and with one more of the planted effects each."""
    task = replace(task, sweeps=gate(task.sweeps).sweeps)
    problem = Problem.posed(task, lambda _: None, None, "bands")
    null = fitted(problem, (), problem.values, near=True, rounds=5)
    few = condensed(problem, null.fit.sizes.colour)
    if few is not problem:
        problem = replace(few, values=null.values)
        null = fitted(problem, (), problem.values, near=True, rounds=5)
    yield (parent := null)
    for planted in truth["findings"]:
        made = with_one_more(problem, parent, own) if (own := places_of(problem, planted)) else None
        if made is not None:
            yield (parent := made)


def line(one: Hypothesis) -> str:
    """Return what is missing, what is left, the errors of formulas, and the effects of a fit."""
    names = ", ".join(f"{its.effect.name}@{its.where}" for its in one.effects) or "no effect"
    sizes = one.fit.sizes
    missing = f"{one.fit.shortfall:7.0f} nats missing, {one.unexplained:.1e} left"
    return f"{missing}, formulas off by {sizes.shape:g} smooth, {sizes.bend:g} rough: {names}"


def ran(seed: int, index: int) -> list[Hypothesis]:
    """Make one case and fit what was planted."""
    with tempfile.TemporaryDirectory() as folder:
        truth = make_case(Path(folder), seed, index)
        job = folder_sample(Path(folder) / truth["name"]).job
        assert job is not None, truth["name"]
        return list(planted_fits(job.task, truth))


def test_what_was_planted_describes_a_recording() -> None:
    """One case in full; all are seen by hand, for a case takes up to half a minute."""
    *_, last = ran(601, 1)
    print(line(last))
    assert last.effects
    assert last.fit.shortfall == 0


def main(seed: int, count: int) -> None:
    """Print the fits of the first cases of a seed."""
    for index in range(count):
        began = time.process_time()
        fits = ran(seed, index)
        print(f"{seed}-{index:03d}, {time.process_time() - began:.0f} s", *map(line, fits), sep="\n  ", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
