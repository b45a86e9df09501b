"""The checks of `pzctl doctor`: this machine, its data folder, connections to instruments, a complete measurement."""

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from ...drivers import open_analyzer
from ...drivers.base.analyzer import Analyzer, OnALine
from ...drivers.base.capabilities import Capabilities
from ...drivers.visa.discover import Discovery, discover
from ...fitters.data_folder import in_folder
from ...models.base.errors import PzctlError
from ...models.sweep_plan import Segment, SweepPlan
from ..client.location import find
from ..files.paths import REMEDY, home
from ..journal.stores.folder_store import LEAST_FREE
from ..samples.sample_selection import NoSamplesError, open_journal

Status = Literal["ok", "note", "fault"]

NEEDED = ("numpy", "scipy", "nlopt", "pyzmq", "pyvisa", "pyvisa-py", "msgspec")
ENOUGH_BYTES = 500_000_000
"""Room for some ten thousand sweeps."""
DEVICES = ("ttyUSB*", "ttyACM*", "usbtmc*", "gpib*")
"""Device files of GPIB adapters (Linux)."""


@dataclass(frozen=True)
class Check:
    """The result of one check."""

    name: str
    status: Status
    """`note`: worth knowing, but no obstacle; `fault`: something that pzctl needs does not work."""
    says: str
    remedy: str = ""
    """What the user can do."""


def checkup(resource: str | None = None, progress: Callable[[str], None] = lambda _: None) -> list[Check]:
    """Run all checks and return the results; none raises. `progress` is called with the name of each check.

    The analyzer at `resource` is identified and makes a short sweep; without `resource`, instruments are searched.
    """
    progress("this machine")
    checks = [_software(), _folder(), _journal(), _daemon()]
    progress("devices and VISA libraries")
    checks += _devices(Path("/dev"))
    checks += _instrument(resource) if resource else _instruments(discover())
    progress("a measurement on the simulated bench, through every part")
    return [*checks, _rehearsal()]


def _software() -> Check:
    try:
        words = ", ".join(f"{name} {version(name)}" for name in NEEDED)
    except PackageNotFoundError as error:
        return Check("software", "fault", f"{error.name} is not installed", "reinstall pzctl with pip")
    return Check("software", "ok", f"pzctl {version('pzctl')} on Python {sys.version.split()[0]}; {words}")


def _folder() -> Check:
    try:
        folder = home()
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"pzctl")
        free = shutil.disk_usage(folder).free
    except OSError as error:
        says = f"the data folder cannot be written: {error}"
        return Check("data folder", "fault", says, REMEDY)
    if free < LEAST_FREE:
        says = f"{folder}: {free >> 20} MB are free; {LEAST_FREE >> 20} MB are needed to measure"
        return Check("data folder", "fault", says, "make room on this disk")
    if free < ENOUGH_BYTES:
        return Check("data folder", "note", f"{folder}: only {free / 1e6:.0f} MB are free", "make room on this disk")
    return Check("data folder", "ok", f"{folder}, {free / 1e9:.1f} GB free")


def _journal() -> Check:
    try:
        journal = open_journal()
        try:
            wrong, events = journal.verify(), journal.size
        finally:
            journal.close()
    except NoSamplesError:
        return Check("journal", "ok", "empty: nothing was measured yet")
    except PzctlError as error:
        return Check("journal", "fault", str(error), "restore the folder from a backup, or move it away")
    if wrong:
        return Check("journal", "fault", f"{len(wrong)} of {events} events are damaged: {wrong[0]}", "check the disk")
    return Check("journal", "ok", f"{events} events, each array checked against its hash")


def _daemon() -> Check:
    location = find(home())
    if location is None:
        return Check("daemon", "ok", "none runs; `pzctl measure` starts one")
    owned = ", ".join(location.analyzers.values()) or location.resource
    return Check("daemon", "ok", f"runs as process {location.pid} and owns {owned}")


def _devices(folder: Path) -> list[Check]:
    """Return a note for each adapter's device file that this user may not open."""
    adapters = sorted(path for pattern in DEVICES for path in folder.glob(pattern))
    return [
        Check(
            "permission",
            "note",
            f"you have no permission to read and write {path}",
            f"join its group: sudo usermod -aG {_group(path)} $USER, then log in again",
        )
        for path in adapters
        if not os.access(path, os.R_OK | os.W_OK)
    ]


def _group(path: Path) -> str:
    try:
        return path.group()
    except (KeyError, OSError):
        return "dialout"


def _instruments(discovery: Discovery) -> list[Check]:
    checks = [
        Check("instrument", "ok" if found.idn else "note", f"{found.resource}: {found.idn or found.says}")
        for found in discovery.found
    ]
    if not any(found.idn for found in discovery.found):
        says, remedy = "none answered", "name it: pzctl doctor --resource HOST:5025; see docs/connecting-a-4294A.md"
        checks.append(Check("instrument", "note", says, remedy))
    return checks + [Check("not scanned", "note", what) for what in discovery.not_scanned]


def _instrument(resource: str) -> list[Check]:
    """Identify the analyzer and make a short, weak sweep that uses the whole path; skip an analyzer of the daemon."""
    location = find(home())
    if location is not None and resource in (location.resource, *location.analyzers.values()):
        return [Check("instrument", "ok", f"the daemon owns {resource}, so it was not used; see `pzctl status`")]
    try:
        analyzer = open_analyzer(resource)
        try:
            identity = analyzer.identify()
            checks = [Check("instrument", "ok", f"{identity.name}: {identity.idn}")]
            if isinstance(analyzer, OnALine):
                checks.append(_path(analyzer, analyzer.hears_requests))
        finally:
            analyzer.close()
    except PzctlError as error:
        return [Check("instrument", "fault", str(error), "see docs/connecting-a-4294A.md")]
    return checks


def _path(analyzer: Analyzer, hears_requests: bool) -> Check:
    begun = time.monotonic()
    (sweep,) = analyzer.measure(_short(analyzer.capabilities))
    signal = "by its service request" if hears_requests else "by polling the status byte"
    says = f"{sweep.frequency.size} points swept and read in {time.monotonic() - begun:.1f} s, settings read back"
    notes = (says, f"the end of a sweep is seen {signal}", *sweep.notes)
    return Check("path", "note" if sweep.notes else "ok", "; ".join(notes))


def _short(can: Capabilities) -> SweepPlan:
    """Return the plan of a harmless sweep that lasts some hundredths of a second."""
    start = min(max(1e6, can.frequency_Hz[0]), can.frequency_Hz[1] / 2)
    level = min(max(0.1, can.oscillator_V[0]), can.oscillator_V[1])
    return SweepPlan((Segment(start, 2 * start, 11),), oscillator_V=level, bandwidth=can.bandwidths[0])


def _rehearsal() -> Check:
    """Measure and fit the simulated disk through daemon, VISA, journal, sockets and fitter, in a temporary folder."""
    from ..client.client import connect
    from ..files.builds.build_file import THESIS_BUILD, read_build
    from ..files.daemon_options import DaemonOptions
    from .launch import start

    begun = time.monotonic()
    build = read_build(THESIS_BUILD)
    try:
        with _own_folder():
            location = start(DaemonOptions(fitters=("mason",), simulator={"time_scale": 0.0}))
            with connect(location.events, location.requests) as lab:
                try:
                    measurement = lab.measure(build, "disk")
                    fitted = lab.wait_fit("mason", measurement.id).constants["disk.c33D"]
                    true = float(lab.bench({"command": "truth"})["constants"]["disk.c33D"]["re"])
                finally:
                    lab.shutdown()
    except (PzctlError, OSError) as error:
        return Check("rehearsal", "fault", str(error), "if nothing is wrong on your side, this is a defect of pzctl")
    off = abs(fitted.re - true) / (fitted.u_re or true)
    says = (
        f"a simulated disk was measured, recorded, published and fitted in {time.monotonic() - begun:.1f} s; "
        f"c33D is {off:.1f} standard uncertainties from its true value"
    )
    if off > 4:
        return Check("rehearsal", "fault", says, "this is a defect of pzctl")
    return Check("rehearsal", "ok", says)


@contextmanager
def _own_folder() -> Generator[None]:
    """Use a temporary data folder, which is removed afterwards."""
    with (
        tempfile.TemporaryDirectory(prefix="pzctl-doctor-", ignore_cleanup_errors=True) as folder,
        in_folder(Path(folder)),
    ):
        yield
