"""Parameters of what lies on a part of a face, where it causes a satellite of each resonance."""

from collections.abc import Sequence

from .effect import EffectParameter

FRACTION = EffectParameter("fraction", "1", typical=0.01, upper=0.5, prior=(0.03, 1.3))
"""The part of the face."""
_RESTING = 0.3
"""Size while the effect is absent, in its natural unit: a dot of 0.15 mm of solder on 0.5 mm of PZT; a tip of 0.2 mm on
a ceramic, 2 E/(pi a), is about as stiff at 4 MHz."""


def satellite(name: str, unit_name: str, unit: float, sizes: Sequence[float]) -> EffectParameter:
    """Return the parameter that sets the satellite's frequency; `sizes` to try are in `unit`, its natural size."""
    return EffectParameter(
        name,
        unit_name,
        typical=0.1 * unit,
        lower=1e-3 * unit,
        upper=100 * unit,
        null=_RESTING * unit,
        scan=tuple(size * unit for size in sizes),
        varies=True,
    )
