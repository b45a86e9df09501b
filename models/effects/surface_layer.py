"""`surface-layer`: a depoled or dead layer under a face of a piezoelectric layer."""

from collections.abc import Mapping
from dataclasses import replace

from ..base.face_loads import DeadLayer, HasFaces
from ..base.model import Model
from ..stack import Piezo, Stack
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, layer_at

_SHARED = ("density", "c33D.re", "c33D.im", "eps33S.re", "eps33S.im")
"""Constants of the dead layer that follow from the live one's."""
_DEAD = (4e-6, 1.5)
"""Prior depth: median in m, standard deviation of the logarithm; ground and lapped ceramics are dead to some um."""
_DEEPER, _LESS = (_DEAD[0] * 2.33, 0.826 * _DEAD[1]), (_DEAD[0] / 2.33, 0.826 * _DEAD[1])
"""The same of the deeper and the less deep of two such layers: order statistics of two normal logarithms."""
_MOST = 0.8
"""Largest part of the thickness that may be dead."""


class SurfaceLayer(Effect):
    """h33 = 0 down to a depth: even overtones appear if one face is dead, the overtones' coupling falls if both are.

    It also represents graded piezoelectricity: h33 (1 - exp(-z/d)) equals a dead layer of sqrt(2) d, to 2e-5 of Z for
    d = 10 um in 0.5 mm. Without polarisation a ceramic is softer and its permittivity along the thickness another. On a
    disk of finite diameter a dead side also excites bending, whose overtones lie between the others.
    """

    name = "surface-layer"
    sizes = 2
    lies_on_faces = DeadLayer
    says = "The ceramic of {where} is dead or depoled under a face (by grinding, soldering or heat)."
    separates = (
        "compare the coupling of first and third overtone, look for a resonance at twice the frequency, lap a face"
    )
    references = ("Jaffe, Cook and Jaffe, Piezoelectric Ceramics (1971): depoling by stress",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every piezoelectric layer; none where several are wired in parallel."""
        piezos = [layer for layer in stack.layers if isinstance(layer, Piezo)]
        if len(piezos) > 1 and stack.connection == "parallel":
            return ()
        return tuple(f"layer:{layer.name}" for layer in piezos if layer.h33 != 0)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the dead thickness under the back and under the front face in metre, and the dead ceramic's constants.

        Stiffness and permittivity are relative to the live ceramic's c33D and eps33S.
        """
        thickness = stack.parameters()[f"{layer_at(where)}.thickness"]
        typical, most = 0.005 * thickness, 0.4 * thickness
        return (
            EffectParameter("back", "m", typical, upper=most, prior=_DEAD),
            EffectParameter("front", "m", typical, upper=most, prior=_DEAD),
            EffectParameter("stiffness", "1", typical=0.1, lower=0.7, upper=1.2, null=1.0),
            EffectParameter("permittivity", "1", typical=0.1, lower=0.6, upper=1.7, null=1.0),
        )

    def parameters_in(self, model: Model, nominal: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the same; of a disk of finite diameter the deeper layer is that of the front."""
        plate = self.effect_parameters(nominal, where)
        if not isinstance(model, HasFaces):
            return plate
        back, front, stiffness, permittivity = plate
        return (replace(front, prior=_DEEPER), replace(back, prior=_LESS), stiffness, permittivity)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the layer divided into dead and live ones."""
        if not assembly.parts:
            depths = values["front"], values["back"]
            if sum(depths) <= 0:
                return assembly
            ratios = values.get("stiffness", 1.0), values.get("permittivity", 1.0)
            return assembly.on_face(where, DeadLayer(*depths, *ratios))
        name, depths = layer_at(where), {side: values[side] for side in ("back", "front")}
        if sum(depths.values()) <= 0:
            return assembly
        ratios = {"c33D": values.get("stiffness", 1.0), "eps33S": values.get("permittivity", 1.0)}
        own = f"{self.key}@{where}."
        return replace(assembly, parts=tuple(_with_dead(part, name, depths, ratios, own) for part in assembly.parts))


def _with_dead(
    part: ParallelSection, name: str, depths: Mapping[str, float], ratios: Mapping[str, float], own: str
) -> ParallelSection:
    """Return the part with dead layers of these depths, at most `_MOST` of the layer, under its faces."""
    layers = part.stack.layers
    k = next(k for k, layer in enumerate(layers) if layer.name == name)
    whole = layers[k]
    if not isinstance(whole, Piezo):
        return part
    scale = min(1.0, _MOST * whole.thickness / sum(depths.values()))
    unpoled = replace(whole, c33D=whole.c33D * ratios["c33D"], eps33S=whole.eps33S * ratios["eps33S"], h33=0j)
    dead = {
        side: replace(unpoled, name=f"{name}-dead-{side}", thickness=depth * scale)
        for side, depth in depths.items()
        if depth > 0
    }
    live = replace(whole, thickness=whole.thickness - sum(layer.thickness for layer in dead.values()))
    back, front = ([dead[side]] if side in dead else [] for side in ("back", "front"))
    stack = replace(part.stack, layers=(*layers[:k], *back, live, *front, *layers[k + 1 :]), connection="series")
    laws = [key for key in whole.parameters() if key.startswith(("c33D.", "eps33S.")) and key not in _SHARED]
    linked_parameters = {
        f"{name}.{key}": tuple(f"{layer.name}.{key}" for layer in dead.values()) for key in (*_SHARED, *laws)
    }
    scales = {
        f"{layer.name}.{constant}.{key}": part.scale.get(f"{name}.{constant}.{key}", 1.0) * ratio
        for layer in dead.values()
        for constant, ratio in ratios.items()
        for key in ("re", "im")
    }
    made = replace(
        part,
        stack=stack,
        scale={**part.scale, **scales},
        linked_parameters={**part.linked_parameters, **linked_parameters},
    )
    if scale < 1:
        return made
    by_depth = {
        f"{own}{side}": {f"{layer.name}.thickness": 1.0, f"{name}.thickness": -1.0} for side, layer in dead.items()
    }
    by_ratio = {
        f"{own}stiffness": _moved(dead, "c33D", whole.c33D),
        f"{own}permittivity": _moved(dead, "eps33S", whole.eps33S),
    }
    return made.moving({**by_depth, **by_ratio})


def _moved(dead: Mapping[str, Piezo], constant: str, whole: complex) -> dict[str, float]:
    """Return the derivatives of a constant of all dead layers by their ratio to the live layer's, `whole`."""
    parts = {"re": whole.real, "im": whole.imag}
    return {f"{layer.name}.{constant}.{key}": size for layer in dead.values() for key, size in parts.items()}


EFFECT = SurfaceLayer()
