"""`self-heating`: the power of the sweep warms the ceramic while it runs."""

from collections.abc import Mapping

from ..stack import Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.heating import Heating
from .base.softening import SOURCE, USUAL_SOURCE

_COOLING = 15.0
"""Heat that a face loses in still air, by convection and radiation, W/(m2 K)."""
_SOFTER, _MORE = 2e-4, 1e-3
"""Relative changes of stiffness and permittivity per kelvin that would matter."""
_USUAL_TIME = 1.0


class SelfHeating(Effect):
    """time dT/dt = P - T, P = (level/|Z + source|)^2 Re Z; stiffness and permittivity change in proportion to T.

    T is the power that would keep the device as warm; every sweep begins cold. The device takes up most at its series
    resonance, so that a sweep upwards finds the parallel resonance of a warm device, one downwards that of a cold one;
    at twice the level everything is four times as much. In one sweep it is mistaken for a `temperature-drift`, which
    does not depend on the level, or for a `drive-nonlinearity`, which is the same in both directions.
    """

    name = "self-heating"
    stage = Stage.ACQUISITION
    sizes = 2
    errs_in_time = True
    only_named = True
    says = "The sweep warms {where}: it is another device after the resonance than before."
    separates = "sweep up and down, at half the level, or with a pause before the resonance"
    references = (
        "Uchino and Hirose, IEEE Trans. UFFC 48 (2001) 307 (losses and heat in piezoelectrics)",
        "vendors state 50-1200 ppm/K for the resonance of soft PZT",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the piezoelectric layer if there is only one."""
        piezos = [layer.name for layer in stack.layers if isinstance(layer, Piezo)]
        return (f"layer:{piezos[0]}",) if len(piezos) == 1 else ()

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the relative changes of stiffness and permittivity per watt that lasts, and the time constant.

        It is in durations of the step's first sweep. A disk of 1 cm in air is 400 K warmer for each watt, with a time
        constant of a minute; contacts and liquids cool it to a fraction of that.
        """
        per_watt = 1 / (2 * _COOLING * stack.area)

        def change(name: str, per_kelvin: float) -> EffectParameter:
            typical = per_kelvin * per_watt
            return EffectParameter(name, "1/W", typical, lower=-1e3 * typical, upper=1e3 * typical)

        return (
            change("stiffness", _SOFTER),
            change("permittivity", _MORE),
            EffectParameter("time", "1", 0.5, lower=0.02, upper=100.0, null=_USUAL_TIME, scan=(0.1, 1.0, 10.0)),
            SOURCE,
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as recorded by a sweep that warms it."""
        stiffness, permittivity = values["stiffness"], values["permittivity"]
        if stiffness == 0 and permittivity == 0:
            return assembly
        time, source = values.get("time", _USUAL_TIME), values.get("source", USUAL_SOURCE)
        return assembly.recorded(Heating(layer_at(where), stiffness, permittivity, time, source))


EFFECT = SelfHeating()
