"""`polarity`: the recording is inverted or conjugated."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import Stack
from .base.assembly import Assembly, Reading
from .base.effect import TERMINALS, Effect, EffectParameter, Stage


class Polarity(Effect):
    """-Z, Z* or -Z*, which no device has. Two flags, `inverted` and `conjugated`, each 0 or 1; no parameter."""

    name = "polarity"
    stage = Stage.ACQUISITION
    says = "The recording is inverted or conjugated: the sign of R, of X or of the phase is not the usual one."
    separates = "sweep a known capacitor: its R is positive and its X negative"
    references = ("exp(+jwt) throughout; a passive device has Re Z >= 0, a capacitor Im Z < 0",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `terminals`."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return nothing: a sign has no size."""
        return ()

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded, for values `inverted` and `conjugated` of 0 (default) or 1."""
        written = assembly.recorded(Reading(lambda _: -1.0)) if values.get("inverted") else assembly
        return replace(written, conjugated=assembly.conjugated != bool(values.get("conjugated")))


EFFECT = Polarity()
