"""`spurious-resonance`: one further resonance of unknown origin."""

from collections.abc import Mapping
from math import cos, pi, sin

from ..stack import LossLaw, Stack
from .base.assembly import Assembly
from .base.branch import branch
from .base.effect import Effect, EffectParameter, layer_at
from .base.modified_laws import CoupledMode, with_stiffness_law
from .base.scale import capacitance, resonance


class SpuriousResonance(Effect):
    """A mode that no other effect explains: in parallel with the device, within the stiffness of a layer, or both.

    The voltage drives a branch of its own, Y + jw C e^(j phase) f_k^2/(f_k^2 - f^2 + j f f_k/Q); a mode that the strain
    drives, as of a part that is attached, takes c s f_k^2/(f_k^2 - f^2 + j f f_k/Q) from the stiffness.
    """

    name = "spurious-resonance"
    sizes = 2
    several = True
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
        """Return strengths (C/C0 and s), frequency (Hz), Q and the phase of the branch (rad; 0 for an own mode)."""
        f0 = resonance(stack)
        return (
            EffectParameter("strength", "1", typical=1e-3, upper=1.0, prior=(4e-4, 1.6)),
            EffectParameter("stiffness", "1", typical=1e-3, upper=0.3, prior=(4e-4, 1.6)),
            EffectParameter("frequency", "Hz", typical=0.01 * f0, lower=1e-3 * f0, upper=100 * f0, null=0.87 * f0),
            EffectParameter("q", "1", typical=20.0, lower=2.0, upper=1000.0, null=60.0, scan=(25.0, 100.0)),
            EffectParameter("phase", "rad", typical=0.3, lower=-1.5, upper=1.5),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the mode."""
        C = values["strength"] * capacitance(assembly.nominal)
        residue = C * complex(cos(values["phase"]), sin(values["phase"]))
        f_k, q = values["frequency"], values["q"]
        made = assembly.beside(lambda jw: residue * branch(jw, 2 * pi * f_k, q)) if C > 0 else assembly
        if values["stiffness"] == 0 or not made.parts:  # a law of a model that is no stack must be smooth
            return made

        def coupled(law: LossLaw) -> CoupledMode:
            return CoupledMode(law, values["stiffness"], f_k, q)

        return made.each_stack(lambda stack: with_stiffness_law(stack, layer_at(where), coupled))


EFFECT = SpuriousResonance()
