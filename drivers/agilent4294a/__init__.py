"""The Agilent 4294A precision impedance analyzer over any VISA path."""
