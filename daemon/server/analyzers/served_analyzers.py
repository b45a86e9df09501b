"""The daemon's analyzers: each has a name, a queue, a lease and limits of its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from ....models.base.names import among
from ...wire.events import InstrumentInfo
from ...wire.replies import AnalyzerState
from ..access.bench_step import BenchStep
from ..access.lease import Lease
from ..requests.request_errors import RequestError
from .acquisition import Acquisition, MeasurementJob
from .plan_limits import PlanLimits


@dataclass(frozen=True)
class ServedAnalyzer:
    """One analyzer, with the measurements that run and wait on it."""

    name: str
    instrument: InstrumentInfo
    acquisition: Acquisition
    plan_limits: PlanLimits
    bench: str | None
    """`host:port` of the simulator's bench."""
    lease: Lease = field(default_factory=Lease)
    bench_step: BenchStep = field(default_factory=BenchStep)

    @property
    def state(self) -> AnalyzerState:
        """What it measures, and its queue."""
        job = self.acquisition.current
        return AnalyzerState(
            name=self.name,
            instrument=self.instrument,
            bench=self.bench,
            measuring=job.measurement if job else None,
            sample=job.sample if job else None,
            queue=tuple(waiting.measurement for waiting in self.acquisition.waiting),
            lease=self.lease.holder,
        )


class ServedAnalyzers:
    """All analyzers of a daemon, and who may use which."""

    def __init__(self, served: Sequence[ServedAnalyzer], may_use: Callable[[str, str], bool]) -> None:
        """`may_use` returns whether the client of the first name may use the analyzer of the second one."""
        self._served: Mapping[str, ServedAnalyzer] = {one.name: one for one in served}
        self._may_use = may_use

    @property
    def every(self) -> tuple[ServedAnalyzer, ...]:
        """All of them, in the order of the settings."""
        return tuple(self._served.values())

    @property
    def waiting(self) -> int:
        """Number of measurements that wait on any analyzer."""
        return sum(len(one.acquisition.waiting) for one in self.every)

    def of(self, client: str) -> tuple[ServedAnalyzer, ...]:
        """Return those that a client may use. Raises RequestError if there is none."""
        usable = tuple(one for one in self.every if self._may_use(client, one.name))
        if not usable:
            raise RequestError(
                "not-allowed",
                f"the key of {client!r} is for none of the analyzers here, {', '.join(self._served)}",
                "ask the daemon's administrator for a key that names one",
            )
        return usable

    def check_every(self, client: str) -> None:
        """Raise RequestError if the client's key is not for every analyzer."""
        usable = self.of(client)
        if len(usable) < len(self._served):
            raise RequestError(
                "not-allowed",
                f"the key of {client!r} is for {', '.join(one.name for one in usable)}; this needs one for every "
                f"analyzer here, {', '.join(self._served)}",
            )

    def named(self, name: str | None, client: str) -> ServedAnalyzer:
        """Return the analyzer of this name, or the first one that the client may use. Raises RequestError."""
        usable = self.of(client)
        if name is None:
            return usable[0]
        if name not in self._served:
            raise RequestError("no-such-analyzer", f"analyzer {name!r} is not known; {among(name, list(self._served))}")
        found = self._served[name]
        if found not in usable:
            raise RequestError(
                "not-allowed",
                f"the key of {client!r} is for {', '.join(one.name for one in usable)}, not for analyzer {name!r}",
            )
        return found

    def of_lease(self, lease: str, client: str) -> ServedAnalyzer:
        """Return the analyzer that this client leases under an id. Raises RequestError if there is no such lease."""
        usable = self.of(client)
        return next((one for one in usable if one.lease.is_of(client, lease)), usable[0])

    def of_measurement(self, measurement: str, client: str) -> ServedAnalyzer:
        """Return the analyzer on which a measurement runs or waits, or the first one. Raises RequestError."""
        usable = self.of(client)

        def jobs(one: ServedAnalyzer) -> list[MeasurementJob]:
            return [job for job in (one.acquisition.current, *one.acquisition.waiting) if job is not None]

        return next((one for one in usable if any(job.measurement == measurement for job in jobs(one))), usable[0])
