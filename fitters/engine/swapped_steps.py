"""Swapped recordings: whether a step that no fit describes is described by the recording of a later one."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...models.sweep import Sweep
from ..interface import FitError

WRONG = 0.2
"""RMS log error of a step that missing physics rarely leaves; from here on an exchange is tried."""
_RIGHT, _BETTER = 0.05, 0.3
"""RMS log error, and part of that without the exchange, up to which exchanged recordings are described."""
_POINTS = 200
"""Points per recording: enough to tell one step from another."""


def refuse_swapped(
    sweeps: Mapping[str, Sequence[Sweep]],
    step: str,
    left: float,
    described: Callable[[Mapping[str, tuple[Sweep, ...]]], float],
) -> None:
    """Raise FitError if exchanging the recordings of `step` and of a later step describes both far better.

    `left`: RMS log error of the fit up to `step`, infinite if it failed. `described` returns that of the fit of other
    recordings; it is called with those up to `step` first, which are fitted in a moment if they belong there.
    """
    few = {name: tuple(map(_thinned, of_step)) for name, of_step in sweeps.items()}
    order = list(few)
    for later in order[order.index(step) + 1 :]:
        exchanged = {**few, step: few[later], later: few[step]}
        for last in (step, later):
            now = described({name: exchanged[name] for name in order[: order.index(last) + 1]})
            if not now < min(_RIGHT, _BETTER * left):
                break
        else:
            before = f"leaves an RMS log error of {left:.2g}" if np.isfinite(left) else "fails"
            both = f"{step!r} ({_names(sweeps[step])}) and {later!r} ({_names(sweeps[later])})"
            raise FitError(
                f"the recordings of steps {both} seem to be swapped: the fit {before}, with the two exchanged it "
                f"leaves an RMS log error of {now:.2g}"
            )


def _thinned(sweep: Sweep) -> Sweep:
    every = slice(None, None, max(1, int(np.ceil(sweep.frequency.size / _POINTS))))
    return sweep.at(every)


def _names(sweeps: Sequence[Sweep]) -> str:
    return ", ".join(sweep.name or "no name" for sweep in sweeps)
