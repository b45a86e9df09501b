"""Measurements that would decide what a diagnosis leaves open, as the JSON that `diagnose` requests are answered with.

`would_measure` holds the proposals, each with its plan; `compared` what measurements that were made already show
without any model.
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
    """Return what further measurements of the last step show, and where asked which ones would decide the rest.

    `own` has the step's own sweeps only, `task` those made to decide as well.
    """
    step = list(own.sweeps)[-1]
    further = task.sweeps[step][len(own.sweeps[step]) :]
    found: dict[str, Any] = {}
    if further:
        found["compared"] = [one.says for one in compared(own.sweeps[step], further)]
    if propose:
        instrument = capabilities_of(str(own.sweeps[step][0].settings.get("instrument", "")))
        found["would_measure"] = [_proposal(one, diagnosis) for one in proposals(task, diagnosis, instrument)]
    return found


def plan_in(proposal: dict[str, Any]) -> SweepPlan:
    """Return the plan of an entry of `would_measure`."""
    return msgspec.convert(proposal["plan"], SweepPlan)


def _proposal(one: Proposal, diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "kind": one.experiment.kind,
        "what": one.experiment.says,
        "why": _why(one, diagnosis),
        "seconds": round(one.seconds, 1),
        "decides": [{"effect": question.effect, "where": question.where} for question in one.decides],
        "separation": one.separation,
        "plan": msgspec.to_builtins(one.experiment.plan),
    }


def _why(one: Proposal, diagnosis: Diagnosis) -> str:
    if not one.separation:
        return "to tell whether what nothing explains sits in the device or in the sweep"
    found = " and ".join(f"{finding.effect} at {finding.where}" for finding in diagnosis.findings)
    unseen, others, once = (
        [_named(question) for question in one.decides if question.kind == kind]
        for kind in ("unseen", "instead", "seen once")
    )
    words = [f"to see whether {_listed(once)} really depends on the sweep, as it should"] if once else []
    if others:
        words.append(f"to tell {found} from {_listed(others)}")
    if unseen:
        words.append(f"to show or exclude {_listed(unseen)}, which the constants absorb")
    return ", and ".join(words)


def _named(question: Question) -> str:
    return f"{question.effect} at {question.where}" + (f" (up to {question.size})" if question.size else "")


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
