"""Lumped circuits, and the circuit between analyzer and device."""
