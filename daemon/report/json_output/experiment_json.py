"""Further measurements that decide a diagnosis, as JSON in the answer to a `diagnose` request.

`would_measure` holds the proposed measurements, each with its plan; `compared` holds sentences about the measurements
already made, from comparing their sweeps without a model.
"""

from typing import Any

import msgspec

from ....drivers import capabilities_of
from ....fitters.diagnosis.design.experiment_design import Proposal, Question, proposals
from ....fitters.diagnosis.design.sweep_comparison import compared
from ....fitters.diagnosis.findings import Diagnosis
from ....fitters.interface import FitTask
from ....models.sweep_plan import SweepPlan


def deciding_json(task: FitTask, diagnosis: Diagnosis, own: FitTask, propose: bool) -> dict[str, Any]:
    """Return `compared` if there are further measurements of the last step, and `would_measure` if `propose` is set.

    `own` has the step's own sweeps only, `task` those of the further measurements as well.
    """
    step = list(own.sweeps)[-1]
    further = task.sweeps[step][len(own.sweeps[step]) :]
    deciding: dict[str, Any] = {}
    if further:
        deciding["compared"] = [comparison.says for comparison in compared(own.sweeps[step], further)]
    if propose:
        instrument = capabilities_of(str(own.sweeps[step][0].settings.get("instrument", "")))
        proposed = proposals(task, diagnosis, instrument)
        deciding["would_measure"] = [_proposal(proposal, diagnosis) for proposal in proposed]
    return deciding


def plan_in(proposal: dict[str, Any]) -> SweepPlan:
    """Return the plan of an entry of `would_measure`."""
    return msgspec.convert(proposal["plan"], SweepPlan)


def _proposal(proposal: Proposal, diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "kind": proposal.experiment.kind,
        "what": proposal.experiment.says,
        "why": _why(proposal, diagnosis),
        "seconds": round(proposal.seconds, 1),
        "decides": [{"effect": question.effect, "where": question.where} for question in proposal.decides],
        "separation": proposal.separation,
        "plan": msgspec.to_builtins(proposal.experiment.plan),
    }


def _why(proposal: Proposal, diagnosis: Diagnosis) -> str:
    if not proposal.separation:
        return "to tell whether the unexplained misfit is in the device or in the sweep"
    findings = " and ".join(f"{finding.effect} at {finding.where}" for finding in diagnosis.findings)
    unseen, others, once = (
        [_named(question) for question in proposal.decides if question.kind == kind]
        for kind in ("unseen", "instead", "seen once")
    )
    words = [f"to see whether {_listed(once)} depends on the sweep, as it should"] if once else []
    if others:
        words.append(f"to tell {findings} from {_listed(others)}")
    if unseen:
        words.append(f"to show or exclude {_listed(unseen)}, which the constants absorb")
    return ", and ".join(words)


def _named(question: Question) -> str:
    return f"{question.effect} at {question.where}" + (f" (up to {question.size})" if question.size else "")


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
