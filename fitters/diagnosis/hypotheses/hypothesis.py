"""Hypotheses: sets of effects, each fitted by its marginal likelihood, and their posterior probabilities."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import nlargest
from itertools import count

import numpy as np
from scipy.special import chdtri

from ....models.base.arrays import Complexes, Reals
from ....models.effects.base.corrected_constants import Corrections
from ...engine.objective import Objective
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Prior, Recording
from ...error_model.as_stated import as_stated
from ...error_model.at_resonance import at_resonance
from ...error_model.error_sizes import ErrorSizes, Value
from ...error_model.marginal import Marginal
from ...error_model.marginal_fit import NEVER, MarginalFit, Minimum, fit, plain
from ...error_model.prior_scales import LEFT, SHAPE
from ...error_model.unexplained import beyond_constants, rms_of, unexplained_at
from ...interface import UNCOMPUTABLE
from ..decision_rules import APPROXIMATE, ASTRAY, COARSENED, ODDS, UNFINISHED
from .own_losses import deviations_of, log_losses, own_losses
from .problem import Candidate, Problem
from .size_priors import SizePriors, block_of, formula_errors, log_tails_of

_EMPTY = ErrorSizes()
_NEGLIGIBLE = 30.0
"""ln odds from which a hypothesis counts as impossible: 1e-13."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of effects with the constants and error sizes that maximise the marginal likelihood."""

    effects: tuple[Candidate, ...]
    fit: MarginalFit
    log_tails: float
    """Logarithm of the tails of all priors, of sizes and of dimensions, over the normal density that the fit used, and
    of the prior of the losses, which the fit did not use."""
    log_volume: float
    """Logarithm of the priors' densities at their largest values."""
    log_odds: float
    losses: tuple[Prior, ...] = ()
    """What is known of the materials' own losses."""

    @property
    def key(self) -> frozenset[Candidate]:
        """The effects as a set."""
        return frozenset(self.effects)

    @property
    def log_evidence(self) -> float:
        """Logarithm of the marginal likelihood."""
        return self.fit.log_evidence + self.log_tails + self.log_volume

    @cached_property
    def log_prior(self) -> float:
        """Logarithm of the prior density of constants, sizes and errors, relative to its largest value."""
        return self.log_tails - 0.5 * self.fit.gram.before.q + self.fit.log_usual + self.log_bent

    @property
    def log_bent(self) -> float:
        """Logarithm of how usual it is that formulas of effects are so wrong, relative to exact ones.

        By the same mixture as what is left: an effect that has to be bent by more than its formula's usual error
        stands for something else, which has the prior odds of any other effect. Otherwise the marginal likelihood
        alone would pay for it, and that counts little beside errors: a resistance bent by a fifth was more probable
        than a dispersion that needs no error.
        """
        return float(np.log(sum(_ways_to_leave(self.fit.bent, SHAPE))))

    @property
    def log_left(self) -> float:
        """Logarithm of how usual it is to leave so much, relative to a good device that leaves nothing.

        It is the density of the rms left, by odds a mixture of two: imperfections of a good device, or a cause that no
        effect describes.
        """
        return float(np.log(sum(_ways_to_leave(self.unexplained, LEFT))))

    @property
    def cause_left(self) -> float:
        """Probability that what it leaves has a cause that no effect describes, by the same mixture."""
        usual, other = _ways_to_leave(self.unexplained, LEFT)
        return other / (usual + other)

    @property
    def unexplained(self) -> float:
        """Rms of ln Z that neither effects nor the instrument explain."""
        return rms_of(self.unexplained_at)

    @cached_property
    def unexplained_at(self) -> Reals:
        """Squared model error |ln Z|^2 at each point, after projecting out the constants; shape (N,)."""
        return unexplained_at(self.fit, self._parameters)

    @property
    def errors(self) -> list[Complexes]:
        """Columns of ln Z of each recording by errors of instrument and model, shape (N, E), in standard deviations."""
        columns = self.fit.gram.columns
        on, d = columns.present(self.fit.sizes.of_columns())
        return [block[:, on] * d for block in columns.blocks]

    def projected(self, changes: list[list[Complexes]]) -> Reals:
        """Return changes of ln Z after projecting out the constants, as columns of shape (2N, K)."""
        return beyond_constants(self.fit, changes, self._parameters)

    @property
    def _parameters(self) -> frozenset[str]:
        return frozenset(name for effect in self.effects for name in effect.parameters)

    @property
    def log_weight(self) -> float:
        """Logarithm of (marginal likelihood times prior odds)."""
        return self.log_evidence + self.log_odds

    @cached_property
    def told(self) -> MarginalFit:
        """The fit with the constants that are told: those at the resonance, for a build as it is stated."""
        return as_stated(self.resonant)

    @cached_property
    def resonant(self) -> MarginalFit:
        """The fit with the constants at the resonance."""
        return at_resonance(self.fit)

    @cached_property
    def values(self) -> dict[str, float]:
        """Every model parameter."""
        return self.fit.values

    @property
    def astray(self) -> bool:
        """Whether its dimensions and constants are further from the build than those of one build in twenty."""
        return _is_astray(self.objective.improbability(self.values))

    @property
    def strained(self) -> bool:
        """Whether its constants are astray, or its errors of the instrument are those of less than one in twenty.

        Then they stand for something that is missing, and hide it.
        """
        return self.astray or not self.fit.has_usual_errors

    @property
    def is_complete(self) -> bool:
        """Whether it leaves nothing that an effect could explain, and nothing that one could bring back.

        It describes the recordings to their noise, the evidence is against any error, smooth or rough, of constants or
        instrument; and constants, dimensions and losses are nearer to what is known beforehand than those of one build
        in twenty.
        """
        if self.fit.shortfall > 0 or not self.fit.exact or self.astray:
            return False
        away = self.objective.improbability(self.values), deviations_of(self.losses, self.fit)
        return not _is_astray(np.concatenate(away))

    @property
    def coarseness(self) -> float:
        """How much ln evidence counts as one nat if this is the best explanation."""
        return coarseness(self.fit.shortfall, self.fit.exact)

    @property
    def objective(self) -> Objective:
        """The objective, weighted by noise alone."""
        return self.fit.marginal.objective


def _is_astray(away: Reals) -> bool:
    """Return whether deviations, in standard uncertainties, are together as large as those of one build in twenty."""
    return away.size > 0 and float(away @ away) > float(chdtri(away.size, ASTRAY))


def _ways_to_leave(left: float, usual: float) -> tuple[float, float]:
    """Return the densities of an rms left by a good device, and by a cause that no effect describes, with their odds.

    Half normal for imperfections of this `usual` size; uniform in its logarithm from there to 1 for a cause, continued
    as a constant below. Relative to the largest of the former.
    """
    good = np.exp(-0.5 * (left / usual) ** 2)
    other = np.sqrt(np.pi / 2) * usual / max(left, usual) / -np.log(usual)
    return float((1 - ODDS) * good), float(ODDS * other)


def beside(effects: Sequence[Candidate], candidates: Sequence[Candidate], *, exact: bool = False) -> list[Candidate]:
    """Return the candidates that can stand beside these effects.

    None of an effect at a place where one of them is; and of those that divide the face into strips only one: the
    strips of two would multiply. `exact`: whether there are no errors but white noise; then a further one can be at the
    same place if there may be several. Otherwise weak lines are among the errors, and further resonances of one layer
    would describe what the formula of a dot leaves of its satellite.
    """
    taken: dict[tuple[str, str], set[int]] = {}
    for one in effects:
        taken.setdefault((one.effect.name, one.where), set()).add(one.effect.number)
    divided = any(one.effect.divides for one in effects)
    left: list[Candidate] = []
    for one in candidates:
        there = taken.get((one.effect.name, one.where), set())
        if (there and not (exact and one.effect.several)) or (divided and one.effect.divides):
            continue
        number = next(k for k in count(one.effect.number) if k not in there)
        left.append(replace(one, effect=one.effect.another(number)) if there else one)
    return left


def coordinates_with(problem: Problem, effects: Sequence[Candidate], values: Mapping[str, float]) -> Coordinates:
    """Return the coordinates of a fit with effects, whose parameters have unit normal priors."""
    values = problem.model.restart(values)
    base = problem.bare_coordinates(values)
    pairs = [(name, knob) for one in effects for name, knob in zip(one.parameters, one.effect_parameters, strict=True)]
    blocks = [*base.blocks, *(block_of(name, knob) for name, knob in pairs)]
    start = {**{name: _start(knob.expected[0], knob.null, knob.from_nothing) for name, knob in pairs}, **values}
    return Coordinates(tuple(blocks), start, (*base.free, *(name for name, _ in pairs)))


def _start(centre: float, null: float, from_nothing: bool) -> float:
    return centre if from_nothing else null


def marginal_of(
    problem: Problem,
    effects: Sequence[Candidate],
    values: Mapping[str, float],
    recordings: Sequence[Recording] | None = None,
) -> Marginal:
    """Return the marginal fit with these effects, starting at `values`."""
    coordinates = coordinates_with(problem, effects, values)
    objective = Objective(recordings or problem.with_effects(effects), coordinates, problem.priors)
    return Marginal.of(objective, SizePriors(effects, coordinates.free), formula_errors(effects), problem.local)


def fitted(
    problem: Problem,
    effects: Sequence[Candidate],
    values: Mapping[str, float],
    starts: Sequence[ErrorSizes] = (_EMPTY,),
    *,
    near: bool = False,
    rounds: int = 3,
    fixed: bool = False,
    others: Sequence[Mapping[str, float]] = (),
    compared: bool = True,
    about: Corrections | None = None,
    barred: Collection[str] = (),
    hopeless: tuple[float, float] = NEVER,
) -> Hypothesis:
    """Fit a hypothesis starting at `values`; `near` means that they are close to the minimum.

    `fixed`: whether errors have the sizes of the first start. `others`: further values from which plain least squares
    start; the fit continues from the lowest minimum. `compared`: whether the evidence has to settle. `about`:
    corrections of constants about which the errors of a fit are linear that ended at `values`. `barred`: parts of the
    error that it has none of, by their names in `ErrorSizes`. `hopeless`: range of weights in which a fit ends.
    """
    marginal = marginal_of(problem, effects, values).around(about)
    x = marginal.objective.coordinates.x
    if not near:
        free = marginal.objective.coordinates.free
        more = [marginal_of(problem, effects, other).objective.coordinates for other in others]
        x = plain(marginal, [x, *(other.x for other in more if other.free == free)])
    beforehand = SizePriors(effects, marginal.objective.coordinates.free).log_volume() + _log_odds(effects)
    between = hopeless[0] - beforehand, hopeless[1] - beforehand
    found = fit(marginal, x, starts, rounds, fixed=fixed, compared=compared, barred=barred, hopeless=between)
    return _weighed(problem, effects, found)


def at_minimum(
    problem: Problem,
    effects: Sequence[Candidate],
    values: Mapping[str, float],
    minimum: Minimum,
    value: Value | None = None,
    anew: Sequence[ErrorSizes] = (),
) -> Hypothesis:
    """Return the hypothesis that `fitted` from these values found in another process or for other recordings.

    `value`: of the likelihood there, for the same recordings. `anew`: sizes of errors to begin with where they are to
    be chosen again, for other recordings.
    """
    found = MarginalFit.at(marginal_of(problem, effects, values), minimum, value)
    return _weighed(problem, effects, found.with_sizes_of(anew) if anew else found)


def end_of(made: Hypothesis | None) -> tuple[Minimum, Value] | None:
    """Return what another process needs to know of a fit, for `at_minimum`; None if it could not be computed."""
    return None if made is None else (made.fit.minimum, made.fit.value)


def computed(make: Callable[[], Hypothesis]) -> Hypothesis | None:
    """Return the hypothesis that is made; None if it cannot be computed, physics or covariance."""
    try:
        made = make()
    except UNCOMPUTABLE:
        return None
    return made if np.isfinite(made.log_weight) else None


def _weighed(problem: Problem, effects: Sequence[Candidate], found: MarginalFit) -> Hypothesis:
    priors = SizePriors(effects, found.marginal.objective.coordinates.free)
    objective, values = found.marginal.objective, found.values
    tails = priors.log_tails(found.x)
    tails += log_tails_of(objective.improbability(values), objective.prior_deviations(values))
    losses = own_losses(problem.losses, effects)
    odds = _log_odds(effects)
    return Hypothesis(tuple(effects), found, tails + log_losses(losses, found), priors.log_volume(), odds, losses)


def _log_odds(effects: Sequence[Candidate]) -> float:
    """Return the logarithm of the prior odds of all these effects."""
    return sum(float(np.log(ODDS * one.effect.odds)) for one in effects)


def coarseness(shortfall: float, exact: bool = False) -> float:
    """Return how much ln evidence counts as one nat, given how far the best explanation falls short.

    `exact`: whether the recording has no errors but white noise, so that its likelihood is no approximation.
    """
    return 1 + (0.0 if exact else APPROXIMATE) + COARSENED * max(0.0, shortfall)


def temper_of(found: Sequence[Hypothesis]) -> float:
    """Return how much ln evidence counts as one nat beside these hypotheses: by what the best of them miss at least.

    That of the largest evidence may explain by unusual errors what another explains by physics: little is missing then.
    """
    best = nlargest(UNFINISHED, found, key=lambda one: one.log_weight)
    return coarseness(min(one.fit.shortfall for one in best), best[0].fit.exact)


def probabilities(found: Sequence[Hypothesis]) -> Reals:
    """Return the posterior probability of each hypothesis, shape (H,), coarsened by what even the best ones miss.

    A likelihood with smooth and rough errors is an approximation, and where even the best hypothesis leaves more than
    noise, it may favour a wrong one by as much evidence as is missing. Evidence is therefore raised to a power, 1 only
    where nothing is missing of an exact recording (coarsened posterior: Miller and Dunson, J. Am. Stat. Assoc. 114
    (2019) 1113). What is known beforehand of sizes and constants is no approximation: a lead of a tenth of the usual
    inductance is as improbable as it was.
    """
    temper = temper_of(found)
    evidence = [one.log_evidence / temper + one.log_odds for one in found]
    weight = np.full(len(found), -np.inf)
    for k, one in sorted(enumerate(found), key=lambda pair: -evidence[pair[0]]):
        if evidence[k] < np.max(weight) - _NEGLIGIBLE:
            break  # priors are at most 1: what is far behind without them stays there
        weight[k] = evidence[k] + one.log_prior * (1 - 1 / temper) + one.log_left
    part = np.exp(weight - np.max(weight))
    return np.asarray(part / np.sum(part), np.float64)
