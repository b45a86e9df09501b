"""Characteristic sizes of a stack, which set the scales of effects, and its active layer."""

import math

from ...stack import CONSTANT, HalfSpace, LossLaw, Piezo, Stack

WATER = 1483.0
"""Speed of sound in water at 20 degrees, m/s."""
_DENSITY, _STIFFNESS, _FIELD, _PERMITTIVITY = 7700.0, 1.5e11, 2e9, 8e-9


def equivalent_plate(name: str, capacitance: float, resonance: float, law: LossLaw = CONSTANT) -> Stack:
    """Return a plate of this clamped capacitance (F) and resonance (Hz): the scale of effects on what is no stack.

    Nothing else of it matters to effects outside of a device; the material is that of a usual ceramic. `law`: of its
    losses, which effects of laws start from.
    """
    thickness = math.sqrt(_STIFFNESS / _DENSITY) / (2 * resonance)
    layer = Piezo(
        name,
        thickness=thickness,
        density=_DENSITY,
        c33D=complex(_STIFFNESS),
        h33=complex(_FIELD),
        eps33S=complex(_PERMITTIVITY),
        c_law=law,
        eps_law=law,
    )
    return Stack((layer,), HalfSpace("air", 0.0), HalfSpace("air", 0.0), capacitance * thickness / _PERMITTIVITY)


def active(stack: Stack) -> Piezo:
    """Return the dominant piezoelectric layer of the stack: the thickest."""
    return max(_piezos(stack), key=lambda layer: layer.thickness)


def _piezos(stack: Stack) -> list[Piezo]:
    return [layer for layer in stack.layers if isinstance(layer, Piezo)]


def resonance(stack: Stack) -> float:
    """Return the frequency at which the piezoelectric layers together are half a wavelength thick, Hz."""
    return 1 / sum(2 * disk.thickness * math.sqrt(disk.density / disk.c33D.real) for disk in _piezos(stack))


def capacitance(stack: Stack) -> float:
    """Return the clamped capacitance of the piezoelectric layers as they are connected, F."""
    each = [disk.eps33S.real * stack.area / disk.thickness for disk in _piezos(stack)]
    return sum(each) if stack.connection == "parallel" else 1 / sum(1 / one for one in each)


def reactance(stack: Stack) -> float:
    """Return 1/(w C0) at the resonance, ohm."""
    return 1 / (2 * math.pi * resonance(stack) * capacitance(stack))


def areal_mass(stack: Stack) -> float:
    """Return the mass of the active layer per area, kg/m2."""
    disk = active(stack)
    return disk.density * disk.thickness


def acoustic_impedance(stack: Stack) -> float:
    """Return sqrt(rho c33D) of the active layer, Rayl."""
    disk = active(stack)
    return math.sqrt(disk.density * disk.c33D.real)
