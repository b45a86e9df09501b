"""`spurious-resonance`: one additional resonance of unknown origin, as a pole pair of the admittance."""

from collections.abc import Mapping
from math import cos, pi, sin

from ..stack import Stack
from .base.assembly import Assembly
from .base.branch import branch
from .base.effect import Effect, EffectParameter
from .base.scale import capacitance, resonance


class SpuriousResonance(Effect):
    """Y + jw C e^(j phase) f_k^2/(f_k^2 - f^2 + j f f_k/Q): a mode that no other effect of the catalogue explains."""

    name = "spurious-resonance"
    says = "There is one additional resonance of unknown origin, which appears with {where}."
    separates = "damp the rim with wax, hold the part elsewhere, or sweep a second sample: a shift shows its origin"
    references = (
        "Gustavsen and Semlyen, IEEE Trans. Power Deliv. 14 (1999) 1052 (pole pairs)",
        "IEEE Standard on Piezoelectricity 176-1987 (the equivalent circuit)",
    )

    @property
    def outside(self) -> bool:
        """Its branch is in parallel with whatever resonates."""
        return True

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer: the step in which it appears shows where it is."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if "thickness" in layer.parameters())

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return strength (C/C0), frequency (Hz), Q and the phase of the residue (rad; 0 for an independent mode)."""
        f0 = resonance(stack)
        return (
            EffectParameter("strength", "1", typical=1e-3, upper=1.0, prior=(4e-4, 1.6)),
            EffectParameter("frequency", "Hz", typical=0.01 * f0, lower=1e-3 * f0, upper=100 * f0, null=0.87 * f0),
            EffectParameter("q", "1", typical=20.0, lower=2.0, upper=1000.0, null=60.0, scan=(25.0, 100.0)),
            EffectParameter("phase", "rad", typical=0.3, lower=-1.5, upper=1.5),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device in parallel with a resonant branch."""
        C = values["strength"] * capacitance(assembly.nominal)
        residue = C * complex(cos(values["phase"]), sin(values["phase"]))
        w_k = 2 * pi * values["frequency"]
        q = values["q"]
        return assembly.beside(lambda jw: residue * branch(jw, w_k, q))


EFFECT = SpuriousResonance()
