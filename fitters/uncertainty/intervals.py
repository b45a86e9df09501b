"""Intervals of constants beside their standard uncertainties."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...models.build import LayerSpec
from ..interface import Constant, FitError, Interval
from .bootstrap import Draws, spread_of
from .derived import derived_of

_FEWEST = 50


def with_intervals(constants: Mapping[str, Constant], found: Mapping[str, Interval]) -> dict[str, Constant]:
    """Return the constants with the intervals of their parameters (`disk.c33D.re`, `ml1.z`)."""
    return {
        name: replace(
            constant, interval_re=found.get(f"{name}.re", found.get(name)), interval_im=found.get(f"{name}.im")
        )
        for name, constant in constants.items()
    }


def with_draws(
    constants: Mapping[str, Constant], derived: Mapping[str, Constant], layers: Sequence[LayerSpec], draws: Draws
) -> tuple[dict[str, Constant], dict[str, Constant], tuple[str, ...]]:
    """Return constants and derived constants with the uncertainties of a bootstrap, and sentences about it.

    Raises FitError if too few of its fits converged.
    """
    total = len(draws.values) + draws.failed
    if len(draws.values) < _FEWEST:
        raise FitError(f"bootstrap: {draws.failed} of {total} repeated fits did not converge; no interval can be given")
    says = (f"{draws.failed} of {total} repeated fits did not converge and are left out.",) if draws.failed else ()
    drawn = [_complex_constants(layers, values) for values in draws.values]
    return _spread(constants, drawn), _spread(derived, drawn), says


def _complex_constants(layers: Sequence[LayerSpec], values: Mapping[str, float]) -> dict[str, complex]:
    """Return all constants and derived constants of one draw."""
    constants: dict[str, complex] = {}
    for name, value in values.items():
        bare = name.removesuffix(".re").removesuffix(".im")
        constants[bare] = constants.get(bare, 0) + (1j * value if name.endswith(".im") else value)
    for layer in layers:
        constants |= derived_of(layer, values)
    return constants


def _spread(constants: Mapping[str, Constant], made: Sequence[Mapping[str, complex]]) -> dict[str, Constant]:
    updated: dict[str, Constant] = {}
    for name, constant in constants.items():
        u_re, re = spread_of(draw[name].real for draw in made)
        u_im, im = spread_of(draw[name].imag for draw in made)
        updated[name] = constant
        if constant.u_re:
            updated[name] = replace(updated[name], u_re=u_re, interval_re=re)
        if constant.u_im:
            updated[name] = replace(updated[name], u_im=u_im, interval_im=im)
    return updated
