"""Instrument artefacts that compete with catalogue effects; without them the most similar effect would be named.

They are never named themselves: a recording that one of them describes best has an `unknown` effect.
"""

from collections.abc import Mapping
from math import pi

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances
from ....models.effects import Assembly, Effect, EffectParameter
from ....models.effects.base.assembly import Reading
from ....models.effects.base.effect import Stage
from ....models.effects.base.scale import resonance
from ....models.stack import Stack

UNKNOWN = "unknown"
ANY = "any"
"""Place of every artefact."""
_NEVER = -0.5, 0.5
"""Limits of a change of ln Z that could still be an artefact."""


class InstrumentArtefact(Effect):
    """A fault of the instrument or its surroundings: at no place of a build, and rarer than catalogue effects."""

    name = UNKNOWN
    odds = 0.1

    @property
    def outside(self) -> bool:
        """The instrument's faults do not depend on the device."""
        return True

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `any`: the instrument is not part of the build."""
        return (ANY,)


class RangeStep(InstrumentArtefact):
    """Z times a constant factor above some frequency, as when the analyzer changes its range."""

    stage = Stage.ACQUISITION
    sizes = 2
    says = "From one frequency on all values differ by a factor, as if the analyzer had changed its range there."
    separates = "sweep again with a fixed range, or at another level"
    references = ("Agilent 4294A Operation Manual, measurement accuracy by range",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the changes of ln |Z| and of the phase (rad), and the frequency of the step (Hz)."""
        low, high = _NEVER
        f0 = resonance(stack)
        return (
            EffectParameter("gain", "1", typical=1e-3, lower=low, upper=high),
            EffectParameter("phase", "rad", typical=1e-3, lower=low, upper=high),
            EffectParameter("frequency", "Hz", typical=0.01 * f0, lower=1e-3 * f0, upper=100 * f0, null=f0),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as an analyzer with this step records it."""
        change = complex(values["gain"], values["phase"])

        def stepped(frequency: Frequencies) -> Complexes:
            # a ramp one point wide instead of a jump, so that the frequency has a derivative and the fit can
            # move it
            beyond = (frequency - values["frequency"]) / float(np.mean(np.diff(frequency)))
            return np.exp(change * np.clip(beyond + 0.5, 0.0, 1.0))

        return assembly.recorded(Reading(stepped))


class PhaseError(InstrumentArtefact):
    """Z times exp(j phase (f/f0)^power), whatever Z is: the phase of the adapter differs from the assumed one."""

    stage = Stage.ACQUISITION
    says = "The phase is off by an angle that grows with frequency whatever the impedance is, as of a wrong adapter."
    separates = "set the adapter again, and sweep a capacitor: its phase tells"
    references = ("Agilent 4294A Operation Manual, adapter phase compensation",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the angle at the resonance (rad) and its exponent in frequency."""
        low, high = _NEVER
        return (
            EffectParameter("phase", "rad", typical=1e-3, lower=low, upper=high),
            EffectParameter("power", "1", typical=0.3, lower=0.3, upper=4.0, null=1.0, scan=(0.5, 1.0, 2.0, 3.0)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as an analyzer with this phase error records it."""
        f0 = resonance(assembly.nominal)

        def turned(frequency: Frequencies) -> Complexes:
            return np.asarray(np.exp(1j * values["phase"] * (frequency / f0) ** values["power"]), np.complex128)

        return assembly.recorded(Reading(turned))


class CoupledLoop(InstrumentArtefact):
    """A loop near the lead, coupled inductively, adds (w M)^2 / Z_loop: a broad resonance in series with the device.

    A braid or metal part near a lead has a Q of a few; a sharper resonance belongs to the device.
    """

    stage = Stage.TERMINALS
    says = "Something resonates beside the lead, in series with the device, as a loop that the lead's field reaches."
    separates = "sweep a short circuit in the same clip: what it shows is not the device's; move the leads"
    references = ("Terman, Radio Engineers' Handbook (1943), section 3 (coupled circuits)",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return M^2/L of the loop (H), its resonance frequency (Hz) and its Q.

        M^2/L is the lead's own inductance, 5 to 50 nH, times the square of the coupling, a tenth and at most a third.
        """
        f0 = resonance(stack)
        return (
            EffectParameter("inductance", "H", typical=1e-9, upper=1.5e-8, prior=(1.6e-9, 1.5)),
            EffectParameter("frequency", "Hz", typical=0.01 * f0, lower=1e-3 * f0, upper=100 * f0, null=0.87 * f0),
            EffectParameter("q", "1", typical=3.0, lower=1.0, upper=20.0, null=4.0, scan=(2.0, 6.0, 15.0)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device in series with the coupled loop."""
        M2_L, w, q = values["inductance"], 2 * pi * values["frequency"], values["q"]

        def lead(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            return Z - M2_L * jw * jw / (jw + w / q + w * w / jw), np.ones_like(Z)

        return assembly.behind(lead)


FLAWS: tuple[InstrumentArtefact, ...] = (RangeStep(), PhaseError(), CoupledLoop())
