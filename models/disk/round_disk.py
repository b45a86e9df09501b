"""Models of a bare round disk: its radial mode alone, or radial and thickness mode in one recording."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ..base.names import require
from ..constants.causal import continued
from ..constants.piezo_constants import Radial
from ..stack import Stack
from ..stack.loss_laws import CONSTANT, LawKind, LossLaw, law_with
from .radial import RadialArm

_FADES_AT = 0.45  # of the thickness mode's antiresonance


@dataclass(frozen=True)
class RadialDisk:
    """A thin disk at frequencies far below its thickness mode. Satisfies `Model`.

    The radial arm in parallel with the capacitance of the disk clamped in its plane, eps33p = eps33T - 2 d31^2/(s11E +
    s12E), including the contribution of the motion through the thickness, mu d33f^2.
    """

    arm: RadialArm
    eps33T: complex
    """F/m."""
    eps_law: LossLaw = CONSTANT
    """Continuation of eps33T from the law's reference frequency."""

    @classmethod
    def of(cls, name: str, constants: Radial, area: float, thickness: float, density: float) -> Self:
        """Return the thin disk with these constants; m2, m, kg/m3. Raises RadialError."""
        arm = RadialArm(name, area, thickness, density, constants.s11E, constants.s12E, constants.d31)
        return cls(arm, constants.eps33T)

    @property
    def radial(self) -> Radial:
        """The radial-mode constants."""
        return Radial(self.arm.s11E, self.arm.s12E, self.arm.d31, self.eps33T)

    def parameters(self) -> dict[str, float]:
        """Return the arm's parameters, and `name.eps33T.re`, `name.eps33T.im` (F/m)."""
        at = f"{self.arm.name}.eps33T"
        own = self.arm.parameters() | {f"{at}.re": self.eps33T.real, f"{at}.im": self.eps33T.imag}
        return own | {f"{at}.{key}": exponent for key, exponent in self.eps_law.parameters().items()}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the disk with these parameters. Raises KeyError for an unknown name."""
        require(values, self.parameters(), "the disk")
        at, old = f"{self.arm.name}.eps33T", self.eps33T
        eps = complex(values.get(f"{at}.re", old.real), values.get(f"{at}.im", old.imag))
        return replace(self, arm=self.arm.replace(values), eps33T=eps, eps_law=law_with(self.eps_law, values, f"{at}."))

    def with_law(self, layer: str, kind: LawKind, change: Callable[[LossLaw], LossLaw]) -> Self:
        """Return the disk with the law of its compliances or of its permittivity changed."""
        if layer != self.arm.name:
            return self
        if kind == "dielectric":
            return replace(self, eps_law=change(self.eps_law))
        laws = {name: change(self.arm.laws.get(name, CONSTANT)) for name in ("s11E", "s12E")}
        return replace(self, arm=replace(self.arm, laws={**self.arm.laws, **laws}))

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        return 1 / (self._clamped(frequency) + self.arm.admittance(frequency))

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N). Raises KeyError for an unknown name."""
        require(names, self.parameters(), "the disk")
        Y, slopes = self.arm.slopes(frequency)
        Z = 1 / (self._clamped(frequency) + Y)
        for name, slope in self._clamped_slopes(frequency).items():
            slopes[name] = slopes.get(name, 0) + slope
        rows = np.array([-slopes[name] * Z for name in names], np.complex128)
        return Z, rows.reshape(len(names), frequency.size)

    def formula_errors(self, frequency: Frequencies) -> dict[str, Reals]:
        """Return the relative standard errors of stiffness and coupling; see `Approximate`."""
        return _errors_of(self.arm, frequency)

    def _empty(self, frequency: Frequencies) -> Complexes:
        """Return jw area/t: the admittance for a permittivity of one."""
        return j_omega(frequency) * self.arm.area / self.arm.thickness

    def _clamped(self, frequency: Frequencies) -> Complexes:
        """Return the admittance of the disk clamped in its plane."""
        constants = {key: value for key, (value, _) in self.arm.constants(frequency).items()}
        eps33T, _ = continued(self.eps_law, self.eps33T, frequency)
        eps33p = eps33T - 2 * constants["d31"] ** 2 / (constants["s11E"] + constants["s12E"])
        return self._empty(frequency) * (eps33p + self.arm.mass(frequency) * self.arm.d33f**2)

    def _clamped_slopes(self, frequency: Frequencies) -> dict[str, Complexes]:
        """Return the derivatives of the clamped disk's admittance by all its parameters."""
        constants, name = self.arm.constants(frequency), self.arm.name
        _, chain = continued(self.eps_law, self.eps33T, frequency)
        plus, d31 = constants["s11E"][0] + constants["s12E"][0], constants["d31"][0]
        empty = self._empty(frequency)
        moved = empty * self.arm.mass(frequency) * self.arm.d33f
        Y, by_mass = self._clamped(frequency), moved * self.arm.d33f
        made = {"area": Y / self.arm.area, f"{name}.thickness": (2 * by_mass - Y) / self.arm.thickness}
        made |= {f"{name}.density": by_mass / self.arm.density, f"{name}.d33f": 2 * moved}
        made |= {f"{name}.eps33T.{part}": empty * size for part, size in chain.items()}
        by_s, by_d = empty * 2 * d31**2 / plus**2, -4 * empty * d31 / plus
        for key, by in (("s11E", by_s), ("s12E", by_s), ("d31", by_d)):
            made |= {f"{name}.{key}.{part}": by * size for part, size in constants[key][1].items()}
        return made


@dataclass(frozen=True)
class BothModes:
    """A disk whose recording runs from the radial through the thickness mode. Satisfies `Model`.

    Y = Y_stack + Y_radial arm. In the expansion of the admittance over the disk's short-circuited modes, every mode is
    a branch in parallel with the fully clamped capacitance; modes of pure thickness motion and of pure radial motion
    are different modes, so their branches add. The capacitances need no further constant: far below its resonance the
    stack is the disk clamped in its plane, eps33S/(1 - kt^2) = eps33p, and below the radial modes the arm adds eps33T -
    eps33p. So eps33T follows, and eps33S = eps33T (1 - kp^2)(1 - kt^2) holds exactly.

    Near the thickness mode the motion is no longer uniform through the thickness, and a uniform field excites the
    overtones less and less. The arm therefore decays as 1/[1 + (f/0.45 fp)^6], fp the antiresonance of the plate: an
    empirical rule from two-dimensional solutions (Pz27 and PIC255, D/t 10 to 40; `tests/benchmarks`). It keeps the sum
    passive, which with weight w is (1 - w) of one passive disk and w of another. Edge and shear modes are missing, as
    in any radial model: at D/t = 20 (Pz27) the error of ln Z is 0.4 % over the first radial modes, 10 % up to half fp,
    15 to 30 % from there through the thickness mode, 0.2 % above it.
    """

    stack: Stack
    arm: RadialArm
    """The radial arm, with the name of the stack's piezo layer and the stack's area, thickness and density."""

    @classmethod
    def of(cls, stack: Stack, name: str, constants: Radial) -> Self:
        """Return the stack's layer `name` with its radial modes; `constants.eps33T` is not used, since it follows.

        Raises KeyError if the stack has no piezo layer of this name, RadialError.
        """
        own = stack.parameters()
        require([f"{name}.c33D.re"], own, "the stack")
        sizes = own["area"], own[f"{name}.thickness"], own[f"{name}.density"]
        return cls(stack, RadialArm(name, *sizes, constants.s11E, constants.s12E, constants.d31))

    @property
    def radial(self) -> Radial:
        """The radial-mode constants, with the resulting eps33T."""
        own, name = self.stack.parameters(), self.arm.name
        c33D, h33, eps33S = (
            complex(own[f"{name}.{key}.re"], own[f"{name}.{key}.im"]) for key in ("c33D", "h33", "eps33S")
        )
        eps33p = eps33S / (1 - h33**2 * eps33S / c33D)
        arm = self.arm
        return Radial(arm.s11E, arm.s12E, arm.d31, eps33p + 2 * arm.d31**2 / (arm.s11E + arm.s12E))

    def parameters(self) -> dict[str, float]:
        """Return the stack's parameters and the arm's: `name.s11E.re`, ..., `name.alpha`."""
        return self.stack.parameters() | self.arm.parameters()

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the disk with these parameters. Raises KeyError for an unknown name."""
        require(values, self.parameters(), "the disk")
        own = self.stack.parameters()
        stack = self.stack.replace({name: value for name, value in values.items() if name in own})
        return replace(self, stack=stack, arm=self.arm.replace(values))

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        Z = self.stack.impedance(frequency)
        return Z / (1 + Z * self._weight(frequency) * self.arm.admittance(frequency))

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N). Raises KeyError for an unknown name."""
        require(names, self.parameters(), "the disk")
        own = self.stack.parameters()
        of_stack = [name for name in names if name in own]
        plate, rows = self.stack.jacobian(frequency, of_stack)
        arm, slopes = self.arm.slopes(frequency)
        weight = self._weight(frequency)
        Z = plate / (1 + plate * weight * arm)
        slopes = {key: weight * slope for key, slope in slopes.items()}
        for key, power in ((self._stiffness, -1), (f"{self.arm.name}.density", 1), (f"{self.arm.name}.thickness", 2)):
            # the weight is 1/(1 + x^3), x ~ thickness^2 density/c33D'
            fading = -3 * power * weight * (1 - weight) * arm / own[key]
            slopes[key] = slopes.get(key, 0) + fading
        made = np.zeros((len(names), frequency.size), np.complex128)
        for k, name in enumerate(names):
            if name in own:  # d ln Z = -Z dY, and dY = -d ln(plate)/plate for what the stack moves
                made[k] += rows[of_stack.index(name)] * (Z / plate)
            if name in slopes:
                made[k] -= Z * slopes[name]
        return Z, made

    def formula_errors(self, frequency: Frequencies) -> dict[str, Reals]:
        """Return those of the radial arm, without those of the modes that the model lacks."""
        return _errors_of(self.arm, frequency)

    @property
    def _stiffness(self) -> str:
        return f"{self.arm.name}.c33D.re"

    def _weight(self, frequency: Frequencies) -> Frequencies:
        """Return the weight of the radial arm at each frequency, shape (N,): 1 far below the thickness mode."""
        speed = np.sqrt(self.stack.parameters()[self._stiffness] / self.arm.density)
        return 1 / (1 + (2 * self.arm.thickness * frequency / (_FADES_AT * speed)) ** 6)


def _errors_of(arm: RadialArm, frequency: Frequencies) -> dict[str, Reals]:
    error = arm.formula_error(frequency)
    return {f"{arm.name}.{constant}": error for constant in ("s11E", "d31")}
