"""Every prior scale of the error model, and the grids on which the recording itself chooses among them.

All are standard deviations of ln Z (or of ln of a constant) unless a unit stands beside them.
"""

INSTRUMENT = 8e-4
"""Gain (ln |Z|) and phase (rad) of an analyzer. A 4294A specifies 7.5e-4 up to 1 MHz, and 1e-3 per MHz more above."""
SLOW, FAST = 1.0, 0.25
"""Correlation lengths in ln f of gain and phase: a calibration error, and what a fixture or a ripple of it makes."""
FIXTURE = {"inductance": 1e-9, "resistance": 1e-2, "skin": 5e-3, "capacitance": 2e-14, "conductance": 3e-9}
"""What open and short compensation leave: H, ohm, ohm at 1 MHz, F, S."""
LENGTH = 0.8
"""Correlation length in ln f of the model's error in each constant."""
IMAGINARY = 0.3
"""Error of the model in a loss, in that of the constant's real part."""
LOSSES = {"c33D": 0.15, "eps33S": 0.15, "h33": 0.1}
"""How far a loss may change over the band, in itself: 1/Q goes as f^-0.15 to f^0.15 in most ceramics."""
FALL = 2e-3
"""Slope of permittivity against ln f that any ceramic has."""
SHAPE = 0.1
"""Smooth error of an effect's formula, relative to the effect: skin effect in a lead, loss in a stray capacitance."""
SHAPE_LENGTH = 1.0
ROUGH_LENGTH = 0.015
"""Correlation length in ln f of what no smooth correction describes: faint lines and scatter."""
ROUGH_FLOOR = 0.5
"""Rough error far from resonances, in that of a point where one constant moves ln Z by as much as itself."""

FEW_SMOOTH, FEW_PATH, FEW_SLOW, FEW_FAST, FEW_SHAPE = 5, 3, 5, 14, 4
"""Functions of each process that are kept; what is left of its variance is below 1e-3 over a decade."""

TAUS = (0.0, 3e-5, 1e-4, 3e-4, 1e-3)
"""Standard deviation of the smooth relative error of a constant."""
RHOS = (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
"""Standard deviation of the rough relative error."""
SHARES = (0.0, 0.3, 1.0)
"""Instrument's slow error and fixture, in units of the specification."""
LIKELY = {0.0: 0.0, 0.3: 0.2, 1.0: 0.8}
"""Prior shares of these where there is an error: an analyzer may be off as much as it is specified to be."""
THERE = (0.0, 1.0)
"""The fixture's residual, in units of its prior."""
QUICK = (0.0, 0.1, 0.3)
"""Instrument's fast error in the same units."""
ON = (0.0, 0.3, 1.0)
"""Losses, in units of their prior scale."""
BENT = (0.0, 0.3, 1.0, 3.0)
"""Effects' shapes, in units of their prior scale."""
BENDS = (0.0, 0.003, 0.01, 0.03, 0.1)
"""Rough error of the effects' formulas, relative to the effect: what differs from the formula near a resonance."""
COLOURS = (0.0, 0.3, 0.5, 0.65, 0.8)
"""Correlation of the noise of neighbouring points (first-order autoregression)."""

NONE = {
    "tau": 0.4,
    "rho": 0.4,
    "slow": 0.4,
    "fast": 0.7,
    "fixture": 0.1,
    "losses": 0.4,
    "shape": 0.4,
    "bend": 0.4,
    "colour": 0.8,
}
"""Prior probability that a part of the error is not there at all; the other values of its grid share the rest."""
FLAWLESS = 0.02
"""The same of the instrument's slow error where the model is not exact: then the recording is a real one."""
EXACT_FIXTURE = 0.999
"""The same of the fixture where the instrument has no error at all: then the recording is no real one."""
