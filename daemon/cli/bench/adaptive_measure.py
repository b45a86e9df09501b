"""`pzctl measure --adaptive`: a fast look, and the plan that comes of it."""

from typing import TYPE_CHECKING

from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from ....drivers.planning.resonances import Resonance
    from ....models.build import Build
    from ....models.sweep_plan import SweepPlan
    from ...client.client import Client


def adapted_plan(lab: "Client", build: "Build", step: str, console: "Console") -> "SweepPlan":
    """Look at the device over the range of the build's own plan; return the plan that takes the same time in all.

    Looks are measurements like any other, in the journal too. Raises UsageError where the build says nothing of what
    to sweep, AdaptiveError where nothing is seen, DaemonError.
    """
    from ....drivers import capabilities_of
    from ....drivers.planning.adaptive import adapted

    if build.plan is None:
        raise UsageError(f"--adaptive: build {build.name!r} has no [sweep]; its range and its time are needed")
    can = capabilities_of(lab.hello().instrument.idn)
    seconds = can.seconds(build.plan)
    found = adapted(build.plan, seconds, lambda plan: lab.measure(build, step, plan).sweeps, can)
    points = sum(segment.points for segment in found.plan.segments)
    console.print(
        f"{step}: looked {len(found.looks)} time(s); {points} points in {len(found.plan.segments)} segments for "
        f"{seconds:.0f} s; resonances in kHz (linewidth): {_listed(found.resonances)}",
        highlight=False,
        soft_wrap=True,
    )
    if found.left_out:
        weak = _listed(found.left_out)
        console.print(f"{step}: left to the background for want of time: {weak}", highlight=False, soft_wrap=True)
    return found.plan


def _listed(resonances: "tuple[Resonance, ...]") -> str:
    return ", ".join(f"{one.frequency / 1e3:.5g} ({one.linewidth / 1e3:.3g})" for one in resonances)
