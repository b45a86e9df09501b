"""Numbers that a sweep's settings have for each point."""

from ...models.base.arrays import Reals


def per_point(values: Reals, digits: int = 3) -> list[float]:
    """Return the values, of shape (N,), to a few digits, as suits an estimate in a message."""
    return [float(f"{value:.{digits}g}") for value in values]


def gain_per_point(values: Reals) -> list[float]:
    """Return the accuracy of gain and phase: steps of three digits would be seen beside the noise."""
    return per_point(values, 5)
