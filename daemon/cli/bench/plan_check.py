"""Whether the daemon will accept a plan, known before anything is glued; the daemon decides again at each request."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ....models.build import Build
    from ....models.sweep_plan import SweepPlan
    from ...client.client import Client
    from ...wire.replies import AnalyzerState


def check_plan(lab: "Client", on: "AnalyzerState", build: "Build", plan: "SweepPlan") -> None:
    """Raise PlanError if a plan exceeds what the analyzer can do, or the limits of its bench or of the sample."""
    from ....drivers import capabilities_of
    from ....models.sweep_plan import LevelLimits
    from ...server.analyzers.plan_limits import PlanLimits

    can = capabilities_of(on.instrument.idn)
    can.check(plan)
    settings = lab.settings()
    own = settings["analyzers"].get(on.name, settings)
    PlanLimits(LevelLimits(own["max_bias_V"], own["max_oscillator_V"])).check(build, plan, can.seconds)
