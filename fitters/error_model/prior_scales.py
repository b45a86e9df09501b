"""All prior scales of the error model, and the grids on which the recording chooses among them.

Values are standard deviations of ln Z (or of ln of a constant) unless a unit is stated.
"""

from ...models.effects import fixture_residual

INSTRUMENT = 8e-4
"""Gain (ln |Z|) and phase (rad) errors of an analyzer. A 4294A specifies 7.5e-4 up to 1 MHz, plus 1e-3 per MHz
above."""
RARE = 0.05
"""How rare an error of an instrument, a fixture or a build is that counts as unusual: in probability of more, or in
density relative to the most frequent one."""
SLOW, FAST = 1.0, 0.25
"""Correlation lengths in ln f of gain and phase: of a calibration error, and of fixture errors or ripple."""
SWITCH = 0.5
"""Step of gain or phase where the analyzer changes its range, in units of its specification. That holds for all ranges
and includes what they have in common, a third of it or more, so two of them differ by less."""
FIXTURE = fixture_residual.TYPICAL
"""Residuals of open and short compensation: H, ohm, ohm at 1 MHz, F, S."""
LENGTH = 0.8
"""Correlation length in ln f of the model's error in each constant."""
IMAGINARY = 0.3
"""Model error of an imaginary part, relative to that of the real part."""
LOSSES = {"c33D": 0.15, "eps33S": 0.15, "h33": 0.1}
"""Relative change of a loss over the band: 1/Q goes as f^-0.15 to f^0.15 in most ceramics."""
FALL = 2e-3
"""Slope of ln permittivity against ln f in any ceramic."""
UNEVEN = 5e-4
"""Standard deviation of a ceramic's thickness over its face, relative: 1 mm with faces parallel to 2 um."""
SHAPE = 0.1
"""Smooth error of an effect's formula, relative to the effect: skin effect in a lead, loss in a stray capacitance."""
SHAPE_LENGTH = 1.0
"""Correlation length of that error in ln f, or in ln(1 + time in sweeps) if the formula is a course in time."""
LINE = 5e-3
"""Height of a weak line, a further resonance too small to be named, where |Z| is that of the clamped capacitance."""
LINE_OFF = 0.1
"""Error of a weak line's frequency in units of its width (and of its Q, relative), times its height in units of LINE.

It is read from what one hypothesis leaves of a recording, and is not fitted again with others."""
ROUGH_LENGTH = 0.015
"""Correlation length in ln f of the rough error: weak lines and scatter."""
ROUGH_FLOOR = 0.5
"""Rough error far from resonances, relative to that at a point with d ln Z / d ln constant = 1."""

LEFT = 8e-4
"""Standard deviation, over good devices, of the rms of ln Z that no constant, no effect and no error of the instrument
explains: scatter of thickness, losses that change over the band. It was 8e-4 in the fits without effects of eight
generated devices that had none. How much more has a cause of its own follows from the odds of both."""
LEFT_AT_MOST = 2 * LEFT
"""What one good device in twenty exceeds: less needs no explanation, and nothing to be searched for."""

FEW_SMOOTH, FEW_PATH, FEW_SLOW, FEW_FAST, FEW_SHAPE = 5, 3, 5, 14, 4
"""Number of functions kept for each process. They neglect 0.3 to 0.8 % of the variance over a decade, up to 3 % at its
ends, and 3 to 7 % over two."""
OF_INSTRUMENT = ("slow", SLOW, FEW_SLOW), ("fast", FAST, FEW_FAST)
"""Parts of the instrument's error, with correlation length and number of functions of each."""

TAUS = (0.0, 3e-5, 1e-4, 3e-4, 1e-3)
"""Standard deviation of the smooth relative error of a constant."""
RHOS = (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
"""Standard deviation of the rough relative error."""
SHARES = (0.0, 0.3, 1.0)
"""Slow instrument error, in units of the specification."""
LIKELY = {0.0: 0.0, 0.3: 0.2, 1.0: 0.8}
"""Prior probabilities of these if there is an error: an analyzer may be off as much as its specification allows."""
THERE = (0.0, 1.0)
"""Residual of the fixture, and uneven thickness, in units of their priors; values that a build holds as exact, in units
of their tolerance."""
QUICK = (0.0, 0.1, 0.3)
"""Fast instrument error in the same units."""
ON = (0.0, 0.3, 1.0)
"""Change of losses, in units of its prior scale."""
BENT = (0.0, 0.3, 1.0, 3.0)
"""Smooth errors of the effects' formulas, in units of their prior scale."""
BENDS = (0.0, 0.003, 0.01, 0.03, 0.1)
"""Rough error of the effects' formulas, relative to the effect: deviations from the formula near a resonance."""
COLOURS = (0.0, 0.15, 0.3, 0.5, 0.65, 0.8)
"""Correlation of the noise of neighbouring points (first-order autoregression)."""

NONE = {
    "tau": 0.4,
    "rho": 0.4,
    "slow": 0.4,
    "fast": 0.7,
    "fixture": 0.1,
    "held": 0.1,
    "losses": 0.4,
    "uneven": 0.4,
    "shape": 0.4,
    "bend": 0.4,
    "colour": 0.8,
}
"""Prior probability that a part of the error is absent; the other values of its grid share the rest."""
FLAWLESS = 0.02
"""The same for the slow instrument error if the model is not exact, which implies a real recording."""
SIMULATED = {"fixture": 0.999, "held": 0.99, "uneven": 0.999}
"""The same for what no simulated recording has, if the instrument has no error at all, which implies one: a fixture's
residual, values that are off though a build holds them as exact, and uneven thickness."""
