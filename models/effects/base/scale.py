"""Characteristic sizes of a stack, which set the scales of effects, and its active layer."""

import math

from ...stack import Piezo, Stack


def active(stack: Stack) -> Piezo:
    """Return the dominant piezoelectric layer of the stack: the thickest."""
    return max((layer for layer in stack.layers if isinstance(layer, Piezo)), key=lambda layer: layer.thickness)


def resonance(stack: Stack) -> float:
    """Return the frequency at which the active layer is half a wavelength thick, Hz."""
    disk = active(stack)
    return math.sqrt(disk.c33D.real / disk.density) / (2 * disk.thickness)


def capacitance(stack: Stack) -> float:
    """Return the clamped capacitance of the active layer, F."""
    disk = active(stack)
    return disk.eps33S.real * stack.area / disk.thickness


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
