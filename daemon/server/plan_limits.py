"""What may be asked to be swept, besides what the analyzer itself can do: checked before a measurement is accepted."""

from collections.abc import Callable
from dataclasses import dataclass

from ...models.build import Build
from ...models.sweep_plan import LevelLimits, PlanError, SweepPlan

MOST_POINTS = 200_000
"""In one measurement: 3.2 MB of impedances, which are held in memory several times over."""
MOST_SEGMENTS = 500
LONGEST_SECONDS = 24 * 3600.0
"""Of one measurement; nobody else measures meanwhile."""


@dataclass(frozen=True)
class PlanLimits:
    """What the bench allows, set by who runs the daemon; what a sample does is said by its build."""

    bench: LevelLimits

    def check(self, build: Build, plan: SweepPlan, seconds: Callable[[SweepPlan], float]) -> None:
        """Raise PlanError where a plan is beyond these limits, those of the sample or of the analyzer.

        `seconds` knows how long the analyzer takes.
        """
        if len(plan.segments) > MOST_SEGMENTS:
            raise PlanError(f"sweep plan: {len(plan.segments)} segments; at most {MOST_SEGMENTS} are allowed")
        points = sum(segment.points for segment in plan.segments)
        if points > MOST_POINTS:
            raise PlanError(f"sweep plan: {points} points; at most {MOST_POINTS} are allowed in one measurement")
        self.bench.check(plan, "this bench")
        if build.limits is not None:
            build.limits.check(plan, f"sample {build.name!r}")
        if (needed := seconds(plan)) > LONGEST_SECONDS:
            raise PlanError(
                f"sweep plan: it would take {needed / 3600:.3g} hours; at most {LONGEST_SECONDS / 3600:.0f} are allowed"
            )
