"""The Agilent 4294A precision impedance analyzer over any VISA path."""

from .instrument import Agilent4294A

__all__ = ["Agilent4294A"]
