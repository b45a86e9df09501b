"""`finite-backing`: echoes from the rear of a backing taken as infinite."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import Stack
from .assembly import Assembly
from .effect import FACES, Effect, Knob
from .loads import Echoing, is_backing
from .scale import resonance

_BACK = FACES[0]
_SPEED, _LENGTHS = 2000.0, (1e-3, 2e-3, 4e-3, 7e-3, 12e-3, 20e-3)
"""m/s, of tungsten-filled epoxy; m, of backings."""


class FiniteBacking(Effect):
    """A ripple with the period 1/delay, as deep as the echo is strong: the backing is a layer with a free rear."""

    name = "finite-backing"
    says = "The backing is not long or lossy enough: an echo from its rear comes back to the disk."
    separates = "load the rear of the backing with water or putty: this ripple changes, that of the rim does not"
    references = (
        "Kossoff, IEEE Trans. Sonics Ultrason. 13 (1966) 20 (backing and matching)",
        "left-out physics 4.2",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `face:back` where a half-space that is no gas is behind it."""
        return (_BACK,) if is_backing(stack.back) else ()

    def knobs(self, stack: Stack, where: str) -> tuple[Knob, ...]:
        """Return the echo's amplitude at the resonance, its delay in s, and its attenuation (Np at the resonance)."""
        delays = tuple(2 * length / _SPEED for length in _LENGTHS)
        return (
            Knob("strength", "1", typical=0.01, upper=0.99),
            Knob("delay", "s", typical=0.1 / resonance(stack), lower=1e-7, upper=1e-3, null=delays[2], scan=delays),
            Knob("decay", "Np", typical=1.0, upper=20.0),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device on a backing that has an end."""
        if values["strength"] <= 0:
            return assembly
        reference = resonance(assembly.nominal)

        def echoing(stack: Stack) -> Stack:
            back = Echoing(stack.back, values["strength"], values["delay"], values["decay"], reference)
            return replace(stack, back=back)

        return assembly.each_stack(echoing)


EFFECT = FiniteBacking()
