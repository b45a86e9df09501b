"""A fitted constant as text, in every table of constants."""

from ...fitters.interface import Constant, is_undetermined
from ...models.base.uncertain_numbers import complex_with_uncertainty

UNDETERMINED = "not determined"


def constant_text(name: str, constant: Constant) -> str:
    """Return `1.514(3)e11 + 1.44(2)e9 j`, or `not determined`."""
    if is_undetermined(name, constant):
        return UNDETERMINED
    return complex_with_uncertainty(constant.re, constant.im, constant.u_re, constant.u_im)
