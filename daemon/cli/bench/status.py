"""`pzctl status`: what the daemon is doing, its counters and its response times."""

from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.names import shown

if TYPE_CHECKING:
    from ...wire.replies import BackupState


def status(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Show what the daemon measures, its queue, the state of its fitters, and response times.

    Example: pzctl status --json
    """
    from ...client.client import connect
    from ...wire.frames import to_json

    with connect() as lab:
        hello, now, metrics = lab.hello(), lab.status(), lab.metrics()
    if as_json:
        print(to_json({"daemon": hello, "status": now, "metrics": metrics}).decode())
        return
    print(f"pzctl {hello.version}, process {hello.pid}, up {metrics.uptime / 3600:.1f} h")
    for analyzer in now.analyzers:
        if len(now.analyzers) > 1:
            print(f"analyzer {shown(analyzer.name)}:")
        simulated = " (simulated)" if analyzer.instrument.simulated else ""
        print(f"instrument: {shown(analyzer.instrument.idn)} at {analyzer.instrument.name}{simulated}")
        measured = shown(f"{analyzer.sample.name} {analyzer.sample.step}") if analyzer.sample else "nothing"
        print(f"measuring: {measured}; {len(analyzer.queue)} waiting")
        if analyzer.lease:
            print(f"leased: {shown(analyzer.lease.owner)} until {analyzer.lease.until}")
    if now.backup:
        print(shown(backup_sentence(now.backup)))
    for fitter in now.fitters:
        named = " ".join(filter(None, (fitter.name, fitter.version)))
        print(f"fitter {shown(named)}: {shown(fitter.says or fitter.state)}")
    counts = metrics.counts
    print(
        f"events: {now.seq}; in this run {counts.get('sweep', 0)} sweeps, {counts.get('fit', 0)} fits, "
        f"{counts.get('requests', 0)} requests, {counts.get('refused', 0)} refused, "
        f"{counts.get('garbage', 0)} garbage, {counts.get('replayed', 0)} events replayed"
    )
    for what, spread in metrics.seconds.items():
        if spread.median is not None and spread.p99 is not None:
            print(f"{what}: median {1e3 * spread.median:.2f} ms, 99 % {1e3 * spread.p99:.2f} ms of {spread.count}")


def backup_sentence(backup: "BackupState") -> str:
    """Return one line about the scheduled backup; it begins with an alarm if there is reason for one."""
    alarm = "ALARM: failed, " if backup.failed else "ALARM: late, " if backup.late else ""
    last = f"last good one {backup.last_success}" if backup.last_success else "none yet"
    running = ", one is running" if backup.running else ""
    said = f": {backup.says}" if backup.says else ""
    return f"backup to {backup.to} every {backup.every_hours:g} h: {alarm}{last}{running}{said}"
