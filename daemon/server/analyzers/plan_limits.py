"""Limits of sweep plans beyond those of the analyzer, checked before a measurement is accepted."""

from collections.abc import Callable
from dataclasses import dataclass

from ....models.build import Build
from ....models.sweep_plan import LevelLimits, PlanError, SweepPlan

MOST_POINTS = 200_000
"""Greatest number of points of one measurement: 3.2 MB of impedances, held in memory several times."""
MOST_SEGMENTS = 500
LONGEST_SECONDS = 24 * 3600.0
"""Longest duration of one measurement, during which nobody else can measure."""


@dataclass(frozen=True)
class PlanLimits:
    """The limits of the bench, from the daemon's settings, and of a sample, from its build."""

    bench: LevelLimits

    def check(self, build: Build, plan: SweepPlan, seconds: Callable[[SweepPlan], float]) -> None:
        """Raise PlanError if a plan exceeds the limits of the bench, the sample or the analyzer.

        `seconds` estimates the duration of a plan and raises PlanError if the analyzer cannot do it.
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
