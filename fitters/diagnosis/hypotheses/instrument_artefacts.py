"""Flaws of the instrument that no catalogue has, to be held against its effects: without them the nearest would win.

They are never named: a recording that one of these describes best has something `unknown` in it.
"""

from collections.abc import Mapping
from math import pi

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances
from ....models.effects import Assembly, Effect, EffectParameter
from ....models.effects.base.effect import Stage
from ....models.effects.base.scale import resonance
from ....models.stack import Stack

UNKNOWN = "unknown"
ANY = "any"
"""Where it is said to sit."""
_NEVER = -0.5, 0.5
"""Limits of ln Z beyond which nobody would take it for a flaw."""


class InstrumentArtefact(Effect):
    """What is wrong with the instrument or around it: no place of a build, and rarer than what a catalogue has."""

    name = UNKNOWN
    odds = 0.1

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `any`: an instrument is no place of a build."""
        return (ANY,)


class RangeStep(InstrumentArtefact):
    """Z times a factor from one frequency on: the analyzer has changed its range there."""

    stage = Stage.ACQUISITION
    sizes = 2
    says = "From one frequency on all values differ by a factor, as if the analyzer had changed its range there."
    separates = "sweep again with a fixed range, or at another level"
    references = ("Agilent 4294A Operation Manual, measurement accuracy by range",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the change of ln |Z|, of the phase (rad), and where it is (Hz)."""
        low, high = _NEVER
        f0 = resonance(stack)
        return (
            EffectParameter("gain", "1", typical=1e-3, lower=low, upper=high),
            EffectParameter("phase", "rad", typical=1e-3, lower=low, upper=high),
            EffectParameter("frequency", "Hz", typical=0.01 * f0, lower=1e-3 * f0, upper=100 * f0, null=f0),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as such an analyzer shows it."""
        change = complex(values["gain"], values["phase"])

        def stepped(_: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            # a ramp as wide as from one point to the next: one point always feels where it is, so that a fit moves it
            beyond = (frequency - values["frequency"]) / float(np.mean(np.diff(frequency)))
            return Z * np.exp(change * np.clip(beyond + 0.5, 0.0, 1.0))

        return assembly.recorded(stepped)


class PhaseError(InstrumentArtefact):
    """Z times exp(j phase (f/f0)^power), whatever Z is: the adapter's phase is not what the analyzer believes."""

    stage = Stage.ACQUISITION
    says = "The phase is off by an angle that grows with frequency whatever the impedance is, as of a wrong adapter."
    separates = "set the adapter again, and sweep a capacitor: its phase tells"
    references = ("Agilent 4294A Operation Manual, adapter phase compensation",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the angle at the resonance (rad), and the power of frequency with which it grows."""
        low, high = _NEVER
        return (
            EffectParameter("phase", "rad", typical=1e-3, lower=low, upper=high),
            EffectParameter("power", "1", typical=0.3, lower=0.3, upper=4.0, null=1.0, scan=(0.5, 1.0, 2.0, 3.0)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as such an analyzer shows it."""
        f0 = resonance(assembly.nominal)

        def turned(_: Assembly, frequency: Frequencies, Z: Impedances) -> Impedances:
            return Z * np.exp(1j * values["phase"] * (frequency / f0) ** values["power"])

        return assembly.recorded(turned)


class CoupledLoop(InstrumentArtefact):
    """Z + (w M)^2 over the impedance of a loop beside the lead: a broad resonance in series.

    A braid or a metal part beside a lead has a Q of a few; what is narrow resonates in the device.
    """

    stage = Stage.TERMINALS
    says = "Something resonates beside the lead, in series with the device, as a loop that the lead's field reaches."
    separates = "sweep a short circuit in the same clip: what it shows is not the device's; move the leads"
    references = ("Terman, Radio Engineers' Handbook (1943), section 3 (coupled circuits)",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return M^2/L of the loop (H), its frequency (Hz) and its Q."""
        f0 = resonance(stack)
        return (
            EffectParameter("inductance", "H", typical=1e-9),
            EffectParameter("frequency", "Hz", typical=0.01 * f0, lower=1e-3 * f0, upper=100 * f0, null=0.87 * f0),
            EffectParameter("q", "1", typical=3.0, lower=1.0, upper=20.0, null=4.0, scan=(2.0, 6.0, 15.0)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device behind such a lead."""
        M2_L, w, q = values["inductance"], 2 * pi * values["frequency"], values["q"]

        def lead(jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
            return Z - M2_L * jw * jw / (jw + w / q + w * w / jw), np.ones_like(Z)

        return assembly.behind(lead)


FLAWS: tuple[InstrumentArtefact, ...] = (RangeStep(), PhaseError(), CoupledLoop())
