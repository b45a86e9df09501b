"""A learned law as a further effect of a conclusion, beside named effects or in place of them, as the evidence says."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from ....models.effects.learned.corrections import INSTRUMENT
from ....models.effects.learned.learned import NAME
from ...error_model.error_sizes import USUAL, ErrorSizes
from ...error_model.prior_scales import LEFT_AT_MOST
from ...interface import UNCOMPUTABLE
from ..decision_rules import CLASS_NATS, NAMED
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate, Problem
from ..inference.conclusion import Conclusion
from ..search.local_errors import with_local_errors, without_strong_lines
from ..validation.forecast import forecast_of
from .drawn_corrections import PlacedCorrection
from .explanations import Choice, Explanation, better, chosen, distinct, enough, explains
from .law_fits import LearnedCorrection
from .laws import learned_laws
from .learned_conclusion import as_sure_as_the_list, concluded, concluded_without_law, with_its_place
from .part_laws import part_laws
from .places import placed_corrections
from .plain_laws import plainly_better_laws
from .sharp_laws import sharp_laws
from .usual_fits import has_usual_fixture, usually_fitted

_SAID = 0.01
"""Smallest probability at which an alternative is mentioned."""
_TRIED = 2
"""Budget: number of places at which laws are fitted, beside those that are as likely."""
_AS_LIKELY = 0.5
"""Probability relative to the likeliest place from which a place counts as likely as it."""
_PARENTS = 4
"""Budget: number of sets of catalogue effects beside which laws are fitted."""
_LAWS = 2
"""Budget: number of laws learned one after the other."""


@dataclass(frozen=True, eq=False)
class Learning:
    """The search for laws beside hypotheses of catalogue effects."""

    problem: Problem
    progress: Callable[[str], None] = lambda _: None
    jobs: int = 1

    def learned(
        self, conclusion: Conclusion, tried: Sequence[Hypothesis]
    ) -> tuple[Conclusion, tuple[PlacedCorrection, ...]]:
        """Return the conclusion with learned laws, and the places of the misfit that the first one describes.

        What no list holds is imitated by what a list holds, often by several effects. Laws are therefore fitted beside
        the named effects, beside none, beside fewer of them, and beside the best single effects that were `tried`, as
        far as the budget goes, and all compete. Artefacts of unknown cause are no such effects: they imitate nothing. A
        line that is too strong to be one of those that every device has is no usual error: it may have a law.
        """
        usual = replace(self, problem=without_strong_lines(self.problem, conclusion.final))
        parents = [conclusion.final, conclusion.null, *(one.without for one in conclusion.named)]
        single = (one for one in tried if len(one.effects) == 1 and one.effects[0].effect.name != UNKNOWN)
        found, places = usual.extended(conclusion, [*parents, *single])
        for _ in range(_LAWS - 1):
            if found is conclusion or _complete(found):
                break
            conclusion = found
            beside = replace(self, problem=self._beside_lines_of(found.final))
            found, _ = beside.extended(found, [found.final, *_without_artefacts(beside.problem, found.final)])
        return as_sure_as_the_list(self._validated(found)), places

    def _validated(self, conclusion: Conclusion) -> Conclusion:
        """Return the conclusion with the forecast of held-out data, if a law was learned."""
        if not any(one.candidate.effect.name == NAME for one in conclusion.named):
            return conclusion
        try:
            return replace(conclusion, forecast=forecast_of(self.problem, conclusion.final))
        except UNCOMPUTABLE:
            return conclusion

    def _beside_lines_of(self, one: Hypothesis) -> Problem:
        """Return the problem with the weak lines beside which a hypothesis was fitted."""
        return replace(self.problem, local=one.fit.marginal.local)

    def extended(
        self, conclusion: Conclusion, parents: Sequence[Hypothesis]
    ) -> tuple[Conclusion, tuple[PlacedCorrection, ...]]:
        """Return the conclusion with one more law, if one is more probable than none."""
        different: dict[frozenset[Candidate], Hypothesis] = {}
        for one in parents:
            different.setdefault(one.key, one)
        explanations: list[Explanation] = []
        places: dict[Hypothesis, tuple[PlacedCorrection, ...]] = {}
        for one in sorted(list(different.values())[:_PARENTS], key=lambda one: len(one.effects)):
            parent = self._alone(one)
            explanations.append(Explanation(parent, None, parent))
            nothing_left = enough(explanations, parent)
            if nothing_left:
                places[parent] = places[nothing_left[0].parent]
                explanations += self._the_same_beside(parent, nothing_left)
                continue
            places[parent], least = self._places(parent, conclusion.something_left)
            explanations += self._laws_beside(parent, places[parent], least)
        choice = chosen(distinct(explanations))
        if choice is None:
            return conclusion, next(iter(places.values()))
        if choice.probability < NAMED:
            known = choice.without_law
            if known is None or not (conclusion.something_left or _was_missed(known, conclusion.final)):
                return conclusion, next(iter(places.values()))
            return concluded_without_law(self.problem, conclusion, choice, known), places[known]
        final = self._final(choice)
        problem = self._beside_lines_of(final)
        if not conclusion.something_left and not better(final, choice.best, _beside(problem, conclusion.final)):
            return conclusion, places[choice.best.parent]
        return concluded(problem, conclusion, choice, final), with_its_place(places[choice.best.parent], choice)

    def _laws_beside(self, parent: Hypothesis, places: Sequence[PlacedCorrection], least: float) -> list[Explanation]:
        """Return the laws that explain something of what a hypothesis leaves; none if the instrument is wrong."""
        if any(one.place == INSTRUMENT and one.probability > NAMED for one in places):
            return []
        made: list[LearnedCorrection] = []
        for placed in _likely(places, least):
            made += learned_laws(self.problem, parent, placed, self.progress)
        found = [Explanation(law.hypothesis, law, parent) for law in made if explains(law, parent)]
        if parent.unexplained <= LEFT_AT_MOST or enough(found, parent):
            return found
        plain = self._plain(parent)
        made = [
            *sharp_laws(self.problem, parent, plain, self.progress),
            *plainly_better_laws(self.problem, parent, plain, self.progress),
            *part_laws(self.problem, parent, plain, self.progress),
        ]
        return [*found, *(Explanation(law.hypothesis, law, parent) for law in made if explains(law, parent))]

    def _the_same_beside(self, parent: Hypothesis, found: Sequence[Explanation]) -> list[Explanation]:
        """Return the best law that leaves nothing beside fewer effects, fitted beside those of another parent.

        It leaves nothing for a law at another place; whether the further effects are there as well is left to evidence.
        """
        best = max(found, key=lambda one: one.hypothesis.log_evidence)
        law, known = best.law, best.hypothesis
        if law is None:
            return []
        effects, values = (*parent.effects, law.candidate), {**parent.values, **known.values}
        try:
            made = usually_fitted(self.problem, effects, values, (known.fit.sizes, parent.fit.sizes))
        except UNCOMPUTABLE:
            return []
        return [Explanation(made, replace(law, hypothesis=made), parent)]

    def _alone(self, one: Hypothesis) -> Hypothesis:
        """Return a hypothesis fitted without smooth errors of the model, which would absorb what a law describes."""
        absorbed = one.fit.sizes.shape > 0 or not has_usual_fixture(one)
        made = [
            usually_fitted(self.problem, one.effects, one.values, (one.fit.sizes,), near=near, barred=("tau", "shape"))
            for near in ((True, False) if absorbed else (True,))
        ]
        return max(made, key=lambda hypothesis: hypothesis.log_evidence)

    def _places(self, parent: Hypothesis, something_left: bool) -> tuple[tuple[PlacedCorrection, ...], float]:
        """Return the places of what a hypothesis leaves, and the probability from which one is tried.

        If none is more likely than not, they are looked for again from the minimum of plain least squares.
        """
        found = placed_corrections(self.problem, parent, self.progress, self.jobs)
        if something_left and max((one.probability for one in found), default=0.0) < NAMED:
            return placed_corrections(self.problem, self._plain(parent), self.progress, self.jobs), _SAID
        return found, (1 - NAMED) / 2

    def _plain(self, one: Hypothesis) -> Hypothesis:
        """Return a hypothesis at the minimum of plain least squares, from which places are looked for.

        Where much is left, the errors of the model have absorbed it at the minimum of the marginal likelihood, and no
        place explains more than they do to first order.
        """
        return fitted(self.problem, one.effects, one.values, (ErrorSizes(),), near=False, rounds=0)

    def _final(self, choice: Choice) -> Hypothesis:
        """Return the best explanation beside its own lines, with smooth errors of the constants if these are better.

        Lines that the catalogue's best explanation has left are no lines of the device if a law explains them. They
        would absorb whatever constants that are slightly wrong leave at these frequencies.
        """
        best = choice.best.hypothesis
        try:
            problem = with_local_errors(self.problem, best)
            best = _beside(problem, best, barred=("tau",))
            made = fitted(problem, best.effects, best.values, (best.fit.sizes,), near=True)
        except UNCOMPUTABLE:
            return best
        return max(best, made, key=lambda one: one.log_evidence) if has_usual_fixture(made) else best


def _complete(found: Conclusion) -> bool:
    """Return whether nothing is left for a further law: everything is explained without more than usual errors."""
    sizes = found.final.fit.sizes
    return found.verdict == "explained" and sizes.tau <= USUAL.tau and sizes.rho <= USUAL.rho


def _was_missed(known: Hypothesis, final: Hypothesis) -> bool:
    """Return whether effects of the catalogue explain clearly more, fitted anew, than what the search ended with.

    Beside errors a fit may end astray, and an effect that leaves nothing then looks as if it explained little.
    """
    temper = max(known, final, key=lambda one: one.log_weight).coarseness
    return known.log_evidence / temper + known.log_odds > final.log_evidence / temper + final.log_odds + CLASS_NATS


def _without_artefacts(problem: Problem, one: Hypothesis) -> list[Hypothesis]:
    """Return a hypothesis without its artefacts of unknown cause, if it has any: a law may be their cause."""
    effects = tuple(effect for effect in one.effects if effect.effect.name != UNKNOWN)
    if effects == one.effects:
        return []
    return [usually_fitted(problem, effects, one.values, (one.fit.sizes, ErrorSizes()))]


def _beside(problem: Problem, one: Hypothesis, barred: Collection[str] = ()) -> Hypothesis:
    """Return a hypothesis fitted beside the weak lines of a problem, without the errors that are `barred`."""
    if set(one.fit.marginal.local) == set(problem.local):
        return one
    return usually_fitted(problem, one.effects, one.values, (one.fit.sizes, ErrorSizes()), barred=barred)


def _likely(places: Sequence[PlacedCorrection], least: float) -> list[PlacedCorrection]:
    """Return the places of at least this probability at which a law is looked for.

    None, if it is likely that the misfit has no place.
    """
    if sum(one.probability for one in places) < NAMED:
        return []
    best = max(one.probability for one in places)
    said = [one for one in places if one.probability > least]
    return [one for k, one in enumerate(said) if k < _TRIED or one.probability >= _AS_LIKELY * best]
