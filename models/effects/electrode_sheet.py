"""`electrode-sheet`: resistance spread over a thin electrode that is contacted in one place."""

from collections.abc import Mapping

import numpy as np
from scipy.special import ive, kve

from ..base.arrays import Complexes, Impedances
from ..base.face_loads import FACES
from ..stack import Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, interfaces
from .base.scale import reactance


class ElectrodeSheet(Effect):
    """Current spreads from a contact over a round electrode of resistance R per square, and leaks through the device.

    Far from resonances this is a series resistance; where the device's impedance is low, the current does not reach the
    rim and the resistance falls. Coupling of neighbouring parts of the device is neglected.
    """

    name = "electrode-sheet"
    stage = Stage.TERMINALS
    stays = True
    odds = 0.1  # contacts and wires are far more common
    says = "The electrode at {where} is thin: its own resistance, spread over the face, is in series with the device."
    separates = "measure the resistance from rim to rim of the electrode, or contact it in several places"
    references = (
        "Ramo, Whinnery and Van Duzer, Fields and Waves in Communication Electronics, chapter 5 (distributed lines)",
        "Abramowitz and Stegun, Handbook of Mathematical Functions, 9.6 (modified Bessel functions)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both electrodes: the outer faces of the piezoelectric layers, glued to something or not."""
        piezo = [isinstance(layer, Piezo) for layer in stack.layers]
        if not any(piezo):
            return ()
        inner = interfaces(stack)
        last = len(piezo) - 1 - piezo[::-1].index(True)
        rear = FACES[0] if piezo[0] else inner[piezo.index(True) - 1]
        return (rear, FACES[1] if last == len(piezo) - 1 else inner[last])

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the resistance per square in ohm and the contact's radius over the electrode's."""
        return (
            EffectParameter("sheet", "ohm", typical=3e-3 * reactance(stack), prior=(0.3, 1.5)),
            EffectParameter("contact", "1", typical=0.1, lower=0.01, upper=0.8, null=0.1),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device behind its electrode."""
        sheet, contact = values["sheet"], values["contact"]
        if sheet == 0:
            return assembly
        return assembly.behind(lambda _, Z: spread(Z, sheet, contact))


def spread(Z: Impedances, sheet: float, contact: float) -> tuple[Impedances, Complexes]:
    """Return the impedance seen at the contact of a round electrode, ohm, and its derivative by Z, shapes (N,).

    The voltage follows V'' + V'/r = u^2 V outside of the contact, r in units of the radius, u^2 = sheet/(pi Z), with
    V' = 0 at the rim. The derivative is that of a reciprocal network: dY_seen/dY is the mean of (V/V_contact)^2.
    """
    u: Complexes = np.sqrt(sheet / (np.pi * Z))
    s = contact
    inner: Complexes = s * u
    outer: Complexes = np.exp(-2 * u * (1 - s))
    # all products are relative to exp(u (1 - s)), so that nothing overflows
    K0, K1, k1 = _decaying(0, inner), _decaying(1, inner), _decaying(1, u)
    I0, I1, i1 = _growing(0, inner), _growing(1, inner), _growing(1, u)
    voltage = I0 * k1 * outer + K0 * i1
    slope = (I1 * k1 * outer - K1 * i1) / voltage  # V'/(u V) at the contact
    rim: Complexes = np.exp(-u * (1 - s)) / (u * voltage)  # V(rim)/V(contact), by the Wronskian
    share = s**2 - 2 * s * slope / u
    return Z / share, (rim**2 + s**2 * slope**2) / share**2


def _decaying(order: int, u: Complexes) -> Complexes:
    """Return K(u) exp(u)."""
    return np.asarray(kve(order, u), np.complex128)


def _growing(order: int, u: Complexes) -> Complexes:
    """Return I(u) exp(-u) for Re u >= 0."""
    return np.asarray(ive(order, u) * np.exp(-1j * u.imag), np.complex128)


EFFECT = ElectrodeSheet()
