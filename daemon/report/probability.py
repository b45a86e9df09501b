"""Probabilities as text, in hundredths and never as certainty.

Each holds among the hypotheses that were compared, and for a model that is right but for them.
"""

_LEAST = 0.01
"""What remains for all that was not compared, at least."""


def probability_text(probability: float | None) -> str:
    """Return `0.93`, `> 0.99` or `< 0.01`; a missing probability is 0."""
    value = probability or 0.0
    if value > 1 - _LEAST:
        return f"> {1 - _LEAST:g}"
    return f"{value:.2f}" if value >= _LEAST else f"< {_LEAST:g}"
