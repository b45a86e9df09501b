"""Which effects are there: a search that keeps several explanations in sight, everything refitted at each step.

Orthogonal matching pursuit over a small beam. An effect is taken in only where it pays for itself by far more than
noise would, measured in units of what is left over and for as many points as are worth counting.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ..hypotheses.problem import Candidate, Problem
from ..inference.evidence import bic_penalty, evidence_lost, gain
from ..validation.whiteness_tests import structured
from .refit import Refit, all_there, refit
from .trial_fits import DESCRIBED, FINER, SIGNIFICANT, polish, resoftened, tried_beside, tried_in_pairs

_EVIDENT = 18.0
"""What of this gain must remain when the freedom of its parameters is paid for: a line may be anywhere in the band."""
_BEAM = (4, 3, 1)
"""How many explanations with one, two and three effects are kept."""
_AS_GOOD = 4.0
"""chi2 over the best one's, up to which an explanation is pursued: the larger one of two effects leads."""
_WITHIN = 30.0
"""How much less likely (-2 ln) than the best an explanation may be to be pursued, once the best describes all."""
_HOPELESS = 0.05
"""Part of the misfit left by two effects from which a third one is not looked for: none of them would be named."""
_NO_ACCIDENT = 3.0
"""chi2 from which one flaw of the instrument, which no effect alone describes, explains a recording for good: what two
effects do, no flaw describes to the noise unless it is faint."""
_MORE_THAN_A_FLAW = 3.0
"""How much more than a flaw of the instrument an effect beside it must bring."""


@dataclass(frozen=True, eq=False)
class Search:
    """Explanations tried so far, so that none is tried twice."""

    problem: Problem
    candidates: tuple[Candidate, ...]
    flaws: tuple[Candidate, ...]
    """Of the instrument: they are held against what was found, and take no part in finding it."""
    progress: Callable[[str], None]
    tried: dict[tuple[tuple[Candidate, ...], frozenset[Candidate]], tuple[Refit, ...]] = field(
        default_factory=dict[tuple[tuple[Candidate, ...], frozenset[Candidate]], tuple[Refit, ...]]
    )
    missed: dict[tuple[Refit, Candidate], Refit] = field(default_factory=dict[tuple[Refit, Candidate], Refit])
    ended: dict[Refit, Refit] = field(default_factory=dict[Refit, Refit])

    def onward(self, current: Refit, against: Refit | None = None) -> tuple[Refit, ...]:
        """Return refits with one effect more than `current`; the best first."""
        return self._all_of(self.candidates, current, against)

    def flawed(self, current: Refit, against: Refit | None = None) -> tuple[Refit, ...]:
        """Return refits with a flaw of the instrument more than `current`; the best first."""
        return self._all_of(self.flaws, current, against)

    def _all_of(self, candidates: tuple[Candidate, ...], current: Refit, against: Refit | None) -> tuple[Refit, ...]:
        key = (candidates, frozenset(current.effects))
        if key not in self.tried:
            self.tried[key] = tuple(tried_beside(self.problem, candidates, current, against))
        return self.tried[key]

    def to_its_end(self, found: Refit, against: Refit) -> Refit:
        """Return a refit that ran out of evaluations, taken on where what it lacks could decide `against` another."""
        if found.descent.converged or evidence_lost(found, against) > _WITHIN:
            return found
        if found not in self.ended:
            self.ended[found] = polish(self.problem, found, FINER)
        return self.ended[found]

    def without(self, found: Refit, effect: Candidate) -> Refit:
        """Return the fit with every effect of `found` but this one."""
        if (found, effect) not in self.missed:
            rest = tuple(one for one in found.effects if one is not effect)
            left = refit(resoftened(self.problem, found), rest, found.values, None)
            self.missed[found, effect] = polish(self.problem, left)
        return self.missed[found, effect]


def beam_search(search: Search, null: Refit) -> Refit:
    """Return the fit with the effects that are there: until the recordings are described or nothing helps any more."""
    best, beam = null, [null]
    for n, kept in enumerate(_BEAM):
        search.progress(f"looking for effect {n + 1}")
        pairs: Sequence[Refit] = ()
        if n == 1 and max(best.chi2) > DESCRIBED:
            flawed = [one for one in search.flawed(null) if _describes(one)] if max(null.chi2) > _NO_ACCIDENT else []
            if flawed:
                return flawed[0]
            pairs = tried_in_pairs(search.problem, search.candidates, null)
            if any(map(_describes, pairs)):
                beam = []  # what else could stand in the place of each is asked for when they are weighed
        beam = _next(search, beam, null, pairs)[:kept]
        if not beam:
            break
        if gain(best, beam[0]) > SIGNIFICANT:
            best = beam[0]
        if max(best.chi2) < DESCRIBED:
            beam = [one for one in beam if max(one.chi2) < DESCRIBED and evidence_lost(one, beam[0]) < _WITHIN]
        elif n and best.chi2_per_dof - 1 > _HOPELESS * (null.chi2_per_dof - 1):
            break
    return best


def _describes(found: Refit) -> bool:
    """Return whether an explanation leaves nothing but noise."""
    return all_there(found) and max(found.chi2) < DESCRIBED and not structured(found.in_noise)


def _next(search: Search, beam: Sequence[Refit], null: Refit, pairs: Sequence[Refit]) -> list[Refit]:
    """Return the best explanations with one effect more than those of the beam, and of the `pairs` beside `null`."""
    onward = [(current, one) for current in beam for one in search.onward(current)]
    found: dict[frozenset[Candidate], Refit] = {}
    for current, one in (*onward, *((null, pair) for pair in pairs)):
        if all_there(one) and gain(current, one) > SIGNIFICANT and evidence_lost(current, one) > _EVIDENT:
            found.setdefault(frozenset(one.effects), one)
    ordered = sorted(found.values(), key=bic_penalty)
    return [one for one in ordered if one.chi2_per_dof < _AS_GOOD * ordered[0].chi2_per_dof]


def backward_elimination(search: Search, found: Refit) -> Refit:
    """Return the refit without the effects whose absence is hardly felt once the others are there."""
    current = found
    for effect in found.effects:
        if len(current.effects) < 2:
            break
        trial = search.without(current, effect)
        if gain(trial, current) < SIGNIFICANT:
            current = trial
    return current


def weightiest(search: Search, found: Refit, most: int) -> Refit:
    """Return the fit with at most so many effects, those left out that are felt least."""
    current = found
    while len(current.effects) > most:
        current = min((search.without(current, effect) for effect in current.effects), key=bic_penalty)
    return current


def drop_artefact_remnants(search: Search, found: Refit) -> Refit:
    """Return the fit without the effects that may be what a flaw of the instrument, drawn roughly, leaves over.

    Beside a flaw only an effect that weighs several times more is believed: mended, the instrument will show the rest.
    """
    flaws = [one for one in found.effects if one in search.flaws]
    others = [one for one in found.effects if one not in search.flaws]
    if not flaws or not others:
        return found
    heaviest = max(gain(search.without(found, one), found) for one in flaws)
    current = found
    for effect in others:
        if gain(search.without(found, effect), found) < _MORE_THAN_A_FLAW * heaviest:
            current = search.without(current, effect)
    return current
