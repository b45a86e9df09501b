"""How sure a finding is: what else could stand in its place, once all other findings are there."""

from dataclasses import dataclass

import numpy as np

from ..findings import Alternative
from ..hypotheses.problem import Candidate
from ..search.beam_search import Search
from ..search.refit import Refit, is_there
from .evidence import bic_penalty, evidence_lost, gain

_RIVALS = 3
_DECIDED = 12.0
_SAME = 0.5
"""Evidence by which two places of one effect differ where they are the same by symmetry: the fits' last digits."""
_CERTAIN = (0.97, 0.93)
"""No finding is said with more, alone or as one of two: there may be what nobody has thought of. Parts that were right
of those that nothing else contested, in a hundred development cases (`pzctl prove`)."""
_ANY_LINE = 0.8
"""The same of a resonance of unknown origin: flaws of no catalogue look like one more often than like anything else."""


@dataclass(frozen=True)
class Weighed:
    """A finding with its weight."""

    candidate: Candidate
    without: Refit
    """The fit with everything but this effect."""
    probability: float
    alternatives: tuple[Alternative, ...]
    same_at: tuple[str, ...]
    """Other places where it would look the same: the far face of a disk between equal loads."""


def posterior_probabilities(search: Search, final: Refit) -> list[Weighed]:
    """Return every effect of the final fit with its probability, the weightiest first."""
    found: list[Weighed] = []
    for candidate in final.effects:
        rest = search.without(final, candidate)
        rivals = _instead(search, rest, candidate, final)[:_RIVALS]
        mirrored = [one for one in rivals if _mirrors(one, candidate, final)]
        rivals = [one for one in rivals if one not in mirrored]
        odds = [float(np.exp(-0.5 * min(max(evidence_lost(one, final), -_DECIDED), 1400.0))) for one in rivals]
        total = 1.0 + sum(odds)
        alternatives = [
            Alternative(rival.effects[-1].effect.name, rival.effects[-1].where, share / total)
            for rival, share in zip(rivals, odds, strict=True)
        ]
        ordered = tuple(sorted(alternatives, key=lambda one: -one.probability))
        sure = _ANY_LINE if candidate.effect.name == "spurious-resonance" else _CERTAIN[len(rest.effects)]
        places = tuple(one.effects[-1].where for one in mirrored)
        found.append(Weighed(candidate, rest, sure / total, ordered, places))
    return sorted(found, key=lambda one: -gain(one.without, final))


def _mirrors(rival: Refit, candidate: Candidate, final: Refit) -> bool:
    """Return whether a rival is the same effect at a place that no recording of this build tells from the first."""
    return rival.effects[-1].effect is candidate.effect and abs(evidence_lost(rival, final)) < _SAME


def better_instead(search: Search, final: Refit) -> Refit:
    """Return the final fit with look-alikes in the place of effects wherever the evidence is for them."""
    current = final
    for candidate in final.effects:
        rivals = _instead(search, search.without(current, candidate), candidate, current)
        for rival in rivals:
            if evidence_lost(rival, current) < 0:
                current = rival
    return current


def _instead(search: Search, rest: Refit, candidate: Candidate, final: Refit) -> list[Refit]:
    """Return the explanations with another effect, or the same elsewhere, in the place of this one, the best first.

    Of one effect the best place only.
    """
    kinds: set[str] = set()
    found: list[Refit] = []
    for one in sorted((*search.onward(rest, final), *search.flawed(rest, final)), key=bic_penalty):
        newest = one.effects[-1]
        if newest is candidate or not is_there(one):
            continue
        if newest.effect.name not in kinds:
            kinds.add(newest.effect.name)
            found.append(search.to_its_end(one, final))
    return found
