"""Protocol of an impedance model: named parameters, replacement of them, Z and its derivatives."""

from collections.abc import Mapping, Sequence
from typing import Protocol, Self, runtime_checkable

from .arrays import Complexes, Frequencies, Impedances, Reals


class Model(Protocol):
    """An impedance over frequency that depends on named real parameters.

    A parameter's name is `layer.constant` (`disk.thickness`, `ml1.q`) in SI units. A complex constant is two
    parameters, its real and imaginary part: `disk.c33D.re`, `disk.c33D.im`. What belongs to no layer stands alone
    or under its own noun: `area`, `back.z`, `lead.inductance`.
    """

    def parameters(self) -> Mapping[str, float]:
        """Return every parameter with its value."""
        ...

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the model with these parameters changed. Raises KeyError for an unknown name."""
        ...

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        ...

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z, shape (N,), and d ln Z / d parameter, shape (P, N), exact, in the order of `names`.

        Raises KeyError for an unknown name.
        """
        ...


@runtime_checkable
class Approximate(Protocol):
    """A model whose formula is an approximation of known accuracy."""

    def formula_errors(self, frequency: Frequencies) -> Mapping[str, Reals]:
        """Return what the neglected terms amount to: the relative standard error of constants, smooth in frequency.

        By name without the part (`disk.s11E`), each of shape (N,) at frequencies in Hz, shape (N,).
        """
        ...
