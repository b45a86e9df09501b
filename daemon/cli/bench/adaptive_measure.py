"""`pzctl measure --adaptive`: fast preliminary sweeps, and the sweep plan made from them."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from ....drivers.planning.resonances import Resonance
    from ....models.build import Build
    from ....models.sweep_plan import SweepPlan
    from ...client.client import Client
    from ...wire.replies import AnalyzerState


def adapted_plan(
    lab: "Client", build: "Build", step: str, plan: "SweepPlan", on: "AnalyzerState", console: "Console"
) -> "SweepPlan":
    """Sweep the range of a plan quickly; return a plan adapted to the resonances seen.

    Preliminary sweeps and adapted plan together take as long as the given one. The preliminary sweeps are ordinary
    measurements and are kept in the journal. Raises AdaptiveError if no resonance is seen, DaemonError.
    """
    from ....drivers import capabilities_of
    from ....drivers.planning.adaptive import adapted

    can = capabilities_of(on.instrument.idn)
    seconds = can.seconds(plan)
    adaptation = adapted(plan, seconds, lambda quick: lab.measure(build, step, quick, analyzer=on.name).sweeps, can)
    points = sum(segment.points for segment in adaptation.plan.segments)
    console.print(
        f"{step}: {len(adaptation.looks)} preliminary sweep(s); {points} points in {len(adaptation.plan.segments)} "
        f"segments for {seconds:.0f} s; resonances in kHz (linewidth): {_listed(adaptation.resonances)}",
        highlight=False,
        soft_wrap=True,
    )
    if adaptation.left_out:
        weak = _listed(adaptation.left_out)
        console.print(f"{step}: no time for segments of their own: {weak}", highlight=False, soft_wrap=True)
    return adaptation.plan


def _listed(resonances: "tuple[Resonance, ...]") -> str:
    return ", ".join(f"{resonance.frequency / 1e3:.5g} ({resonance.linewidth / 1e3:.3g})" for resonance in resonances)
