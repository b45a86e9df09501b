"""What may be asked to be swept, besides what the analyzer itself can do: checked before a measurement is accepted."""

from collections.abc import Callable
from dataclasses import dataclass

from ...models.sweep_plan import PlanError, SweepPlan

MOST_POINTS = 200_000
"""In one measurement: 3.2 MB of impedances, which are held in memory several times over."""
MOST_SEGMENTS = 500
LONGEST_SECONDS = 24 * 3600.0
"""Of one measurement; nobody else measures meanwhile."""


@dataclass(frozen=True)
class PlanLimits:
    """What the bench allows, set by who runs the daemon."""

    bias_V: float | None = None
    oscillator_V: float | None = None

    def check(self, plan: SweepPlan, seconds: Callable[[SweepPlan], float]) -> None:
        """Raise PlanError where a plan is beyond these limits, or those of the analyzer; `seconds` knows its time."""
        if len(plan.segments) > MOST_SEGMENTS:
            raise PlanError(f"sweep plan: {len(plan.segments)} segments; at most {MOST_SEGMENTS} are allowed")
        points = sum(segment.points for segment in plan.segments)
        if points > MOST_POINTS:
            raise PlanError(f"sweep plan: {points} points; at most {MOST_POINTS} are allowed in one measurement")
        if self.bias_V is not None and abs(plan.bias_V) > self.bias_V:
            raise PlanError(f"sweep plan: bias is {plan.bias_V:g} V; this bench allows {self.bias_V:g} V (max_bias_V)")
        voltage = plan.oscillator_V if plan.oscillator_A is None else 0.0
        if self.oscillator_V is not None and voltage > self.oscillator_V:
            raise PlanError(
                f"sweep plan: oscillator is {plan.oscillator_V:g} V; this bench allows {self.oscillator_V:g} V "
                "(max_oscillator_V)"
            )
        if (needed := seconds(plan)) > LONGEST_SECONDS:
            raise PlanError(
                f"sweep plan: it would take {needed / 3600:.3g} hours; at most {LONGEST_SECONDS / 3600:.0f} are allowed"
            )
