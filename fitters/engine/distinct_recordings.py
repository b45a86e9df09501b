"""One recording given twice, to one step or to two: it would be fitted as if its noise had been measured again."""

import re
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from ...models.sweep import Sweep
from ..interface import TaskError

_NUMBER = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
"""The id of a recording that a daemon made. Files without one have their names as ids, which may be the same."""


def refuse_given_twice(sweeps: Mapping[str, Sequence[Sweep]]) -> None:
    """Raise TaskError if two recordings, by step, are one: equal numbers, noise included, or one id of a daemon."""
    every = [(step, sweep) for step, of_step in sweeps.items() for sweep in of_step]
    for (step, one), (other_step, other) in combinations(every, 2):
        if not _same(one, other):
            continue
        named = f"{one.name} and {other.name}" if one.name != other.name else one.name or "it"
        if step == other_step:
            where, needed = f"step {step!r}", "a repeat is another sweep of the same step"
        else:
            where, needed = f"steps {step!r} and {other_step!r}", "each step needs a sweep of its own"
        raise TaskError(f"one recording is given twice, noise included ({named}), for {where}; {needed}")


def _same(one: Sweep, other: Sweep) -> bool:
    if one.id == other.id and _NUMBER.fullmatch(one.id):
        return True
    return np.array_equal(one.impedance, other.impedance) and np.array_equal(one.frequency, other.frequency)
