"""How often held-out data contradict a law that is right, and one that is wrong.

Recordings of a disk with one law at one place, without and with errors of instrument and device: a smooth gain and
phase error of the specification's size, and three weak resonances. The right law is fitted from its true parameters;
a wrong one is the law of another place. A law that holds only in part deviates in one of the held-out blocks.
"""

from dataclasses import dataclass

import numpy as np
from relaxing_disk import BUILD

from pzctl.fitters.diagnosis.decision_rules import FALSE_ALARM
from pzctl.fitters.diagnosis.hypotheses.hypothesis import Hypothesis, fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.search.local_errors import with_local_errors
from pzctl.fitters.diagnosis.validation.forecast import Forecast, forecast_of
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.error_model.prior_scales import LEFT_AT_MOST
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Device
from pzctl.models.effects.learned.corrections import Place
from pzctl.models.effects.learned.learned import LearnedLaw, learned_law
from pzctl.models.stack import Piezo
from pzctl.models.sweep import Sweep

SEED = 40823
F = np.linspace(1.5e6, 7.5e6, 201)
COUNT = 20
"""Recordings of each law, with and without errors."""
LAWS = (
    (Place("terminals", "series"), "inertance", 0.003),
    (Place("terminals", "shunt"), "resistance", 0.003),
    (Place("layer:disk", "permittivity"), "debye", 0.1),
    (Place("layer:disk", "stiffness"), "power", 0.01),
    (Place("face:front", "impedance"), "resistance", 0.01),
)
"""Place, law and its size in natural units."""
DEVIATIONS = (1e-3, 3e-3, 1e-2)
"""Largest deviation of |Z| of a law that does not hold in a held-out block."""
STACK = stack_of(BUILD, BUILD.step("disk"))


@dataclass(frozen=True)
class Drawn:
    """A recording with a law, and the fit of this law."""

    problem: Problem
    law: LearnedLaw
    values: dict[str, float]


def drawn(rng: np.random.Generator, place: Place, name: str, size: float, *, flawed: bool, off: float = 0.0) -> Drawn:
    """Draw a recording with a law of random size; `off`: how far it deviates in a held-out block."""
    law = learned_law(place, name, STACK)
    knobs = {knob.name: knob.expected[0] for knob in law.effect_parameters(STACK, place.where)[1:]}
    values = {"size": size * law.natural * float(np.exp(rng.normal(0, 0.5))), **knobs}
    Z = Device(STACK).with_effect(law, place.where, values).impedance(F)
    if flawed:
        Z = _with_lines(rng, Z) * np.exp(_smooth(rng) + 1j * _smooth(rng))
    middle = F[0] + (F[-1] - F[0]) * rng.choice([3.5, 7.5]) / 11
    Z = Z * (1 + off * np.exp(-(((F - middle) / 1e5) ** 2)))
    noise = rng.normal(size=(2, F.size)) * 2e-4
    task = FitTask(BUILD, {"disk": (Sweep(F, Z * np.exp(noise[0] + 1j * noise[1])),)})
    return Drawn(Problem.of(solve(task, lambda _: None), None), law, values)


def _smooth(rng: np.random.Generator) -> np.ndarray:
    """Return a Gaussian process over ln f, 8e-4 large and with a correlation length of 1."""
    x = np.log(F)
    covariance = np.exp(-0.5 * np.subtract.outer(x, x) ** 2) + 1e-9 * np.eye(F.size)
    return 8e-4 * np.linalg.cholesky(covariance) @ rng.normal(size=F.size)


def _with_lines(rng: np.random.Generator, Z: np.ndarray) -> np.ndarray:
    """Return an impedance with three weak resonances in parallel."""
    disk = next(layer for layer in STACK.layers if isinstance(layer, Piezo))
    C0 = disk.eps33S.real * STACK.area / disk.thickness
    Y = 1 / Z
    for at in rng.uniform(1.6e6, 7.4e6, 3):
        Y = Y + 2j * np.pi * F * C0 * 3e-5 / (1 - (F / at) ** 2 + 1j * F / at / rng.uniform(50, 150))
    return 1 / Y


def fit_of(problem: Problem, law: LearnedLaw, values: dict[str, float]) -> Hypothesis:
    """Return the fit of a law beside the weak lines that it leaves, as the diagnosis fits it."""
    where = law.place.where
    one = Candidate(law, where, ("disk",), law.effect_parameters(STACK, where))
    start = {**problem.values, **{one.prefix + name: value for name, value in values.items()}}
    found = fitted(problem, (one,), start, barred=("tau",))
    beside = with_local_errors(problem, found)
    return found if beside.local == problem.local else fitted(beside, (one,), found.values, near=True)


def outcomes(*, flawed: bool, wrong: bool = False, off: float = 0.0) -> list[tuple[Forecast | None, float]]:
    """Return the forecast of each fit, and the part of ln Z that it leaves unexplained."""
    rng, made = np.random.default_rng([SEED, flawed]), list[tuple[Forecast | None, float]]()
    for k in range(COUNT * len(LAWS)):
        one = drawn(rng, *LAWS[k % len(LAWS)], flawed=flawed, off=off)
        law, values = one.law, one.values
        if wrong:
            place, name, size = LAWS[(k + 1) % len(LAWS)]
            law = learned_law(place, name, STACK)
            knobs = {knob.name: knob.expected[0] for knob in law.effect_parameters(STACK, place.where)[1:]}
            values = {"size": size * law.natural, **knobs}
        found = fit_of(one.problem, law, values)
        made.append((forecast_of(one.problem, found), found.unexplained))
    return made


def _failed(made: list[tuple[Forecast | None, float]]) -> int:
    return sum(forecast is not None and forecast.failed for forecast, _ in made)


def test_a_right_law_is_hardly_ever_contradicted() -> None:
    for flawed in (False, True):
        made = outcomes(flawed=flawed)
        sizes = [forecast.chi2_per_dof for forecast, _ in made if forecast is not None]
        print(
            f"right laws, {'with' if flawed else 'without'} errors: {_failed(made)} of {len(made)} contradicted, "
            f"{len(made) - len(sizes)} undecided, chi2/dof {np.median(sizes):.2f} (median), {max(sizes):.2f} at most"
        )
        assert _failed(made) <= 3 * FALSE_ALARM * len(made) + 2
        assert len(sizes) > 0.9 * len(made)


def test_a_law_that_does_not_hold_in_a_held_out_block_is_contradicted() -> None:
    for off in DEVIATIONS:
        made = outcomes(flawed=True, off=off)
        print(f"laws that are {off:.1%} off in a held-out block: {_failed(made)} of {len(made)} contradicted")
    assert _failed(made) > 0.9 * len(made)


def test_a_wrong_law_that_describes_all_bands_is_not_contradicted() -> None:
    """Held-out blocks lie between others, so errors that describe these describe them as well: evidence must decide."""
    for flawed in (False, True):
        made = outcomes(flawed=flawed, wrong=True)
        little = [one for one in made if one[1] <= LEFT_AT_MOST]
        print(
            f"wrong laws, {'with' if flawed else 'without'} errors: {len(made) - len(little)} of {len(made)} leave "
            f"more than usual; of the other {len(little)}, {_failed(little)} are contradicted; of all, {_failed(made)}"
        )
