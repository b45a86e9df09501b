"""The daemon's counters and times in the text format of Prometheus."""

from collections.abc import Iterator
from datetime import datetime

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.registry import Collector

from ..wire.replies import BackupState, MetricsAnswer, StatusAnswer

CONTENT_TYPE = CONTENT_TYPE_LATEST


def exposition(metrics: MetricsAnswer | None, status: StatusAnswer | None, free: int | None = None) -> bytes:
    """Return the text for a Prometheus server; None for both answers means that no daemon runs.

    `free` is the number of free bytes on the disk of the data folder.
    """
    registry = CollectorRegistry()
    registry.register(_Answers(metrics, status, free))
    return generate_latest(registry)


class _Answers(Collector):
    """The daemon's answers as metric families."""

    def __init__(self, metrics: MetricsAnswer | None, status: StatusAnswer | None, free: int | None) -> None:
        self._free = free
        self._metrics = metrics
        self._status = status

    def collect(self) -> Iterator[Metric]:
        """Yield the metric families."""
        there = self._metrics is not None and self._status is not None
        yield GaugeMetricFamily("pzctl_up", "Whether the daemon answers.", value=float(there))
        if self._free is not None:
            says = "Free on the disk of the data folder."
            yield GaugeMetricFamily("pzctl_disk_free_bytes", says, value=self._free)
        if self._metrics is not None:
            yield from _counted(self._metrics)
        if self._status is not None:
            yield from _state(self._status)


def _counted(metrics: MetricsAnswer) -> Iterator[Metric]:
    counts = CounterMetricFamily("pzctl_counted", "Events by kind, requests, refusals, cut-offs.", labels=["what"])
    for what, count in sorted(metrics.counts.items()):
        counts.add_metric([what], count)
    yield counts
    yield GaugeMetricFamily("pzctl_uptime_seconds", "Since the daemon began.", value=metrics.uptime)
    yield GaugeMetricFamily("pzctl_queue", "Measurements that wait.", value=metrics.queue)
    yield GaugeMetricFamily("pzctl_jobs", "Fits and diagnoses that run or wait.", value=metrics.errands)
    seconds = GaugeMetricFamily("pzctl_seconds", "Lately: publishing, answering, fitting.", labels=["what", "quantile"])
    for what, timing in sorted(metrics.seconds.items()):
        for quantile, value in (("0.5", timing.median), ("0.99", timing.p99)):
            if value is not None:
                seconds.add_metric([what, quantile], value)
    yield seconds


def _state(status: StatusAnswer) -> Iterator[Metric]:
    yield GaugeMetricFamily("pzctl_measuring", "Whether a measurement runs.", value=float(status.measuring is not None))
    yield GaugeMetricFamily("pzctl_last_event", "Number of the last event of the journal.", value=status.seq)
    yield GaugeMetricFamily(
        "pzctl_leased", "Whether somebody has leased the instrument.", value=float(bool(status.lease))
    )
    if status.backup is not None:
        yield from _backup(status.backup)
    fitters = GaugeMetricFamily("pzctl_fitter", "1 for the state that a fitter is in.", labels=["fitter", "state"])
    for fitter in status.fitters:
        fitters.add_metric([fitter.name, fitter.state], 1.0)
    yield fitters


def _backup(backup: BackupState) -> Iterator[Metric]:
    yield GaugeMetricFamily(
        "pzctl_backup_alarm",
        "Whether the last scheduled backup failed or is late.",
        value=float(backup.failed or backup.late),
    )
    for name, time in (("success", backup.last_success), ("failure", backup.last_failure)):
        if time is not None:
            seconds = datetime.fromisoformat(time).timestamp()
            yield GaugeMetricFamily(f"pzctl_backup_last_{name}_timestamp_seconds", f"Last {name}.", value=seconds)
