"""How sure a share is: Wilson's interval, which holds for few cases and for shares near 0 and 1 too.

E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
"""

import math
from dataclasses import dataclass

_Z = 1.959964
"""Standard normal deviate of a 95 % interval."""


@dataclass(frozen=True)
class HitShare:
    """So many of so many; shares of several runs add up."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """Part, 0 to 1; nan of none."""
        return self.hits / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the share behind it."""
        if not self.of:
            return 0.0, 1.0
        n, p, z2 = self.of, self.value, _Z**2
        middle, half = p + z2 / (2 * n), _Z * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        return max((middle - half) / (1 + z2 / n), 0.0), min((middle + half) / (1 + z2 / n), 1.0)

    def __add__(self, other: "HitShare") -> "HitShare":
        return HitShare(self.hits + other.hits, self.of + other.of)

    def __str__(self) -> str:
        if not self.of:
            return "-"
        low, high = self.interval
        return f"{100 * self.value:.1f} % ({100 * low:.0f} to {100 * high:.0f})"


def share(flags: "list[bool]") -> HitShare:
    """Return how many are true."""
    return HitShare(sum(flags), len(flags))
