"""What `pzctl doctor` looks at: this machine, its data folder, the ways to an instrument, and a whole measurement."""

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

from ...drivers.agilent4294a import Agilent4294A
from ...drivers.visa.discover import Discovery, discover
from ...drivers.visa.resources import open_analyzer
from ...fitters.data_folder import in_folder
from ...models.base.errors import PzctlError
from ...models.sweep_plan import Segment, SweepPlan
from ..client.location import find
from ..files.paths import REMEDY, home
from ..samples.sample_selection import NoSamplesError, open_journal

Status = Literal["ok", "note", "fault"]

NEEDED = ("numpy", "scipy", "nlopt", "pyzmq", "pyvisa", "pyvisa-py", "msgspec")
ENOUGH_BYTES = 500_000_000
"""Room for some ten thousand sweeps."""
DEVICES = ("ttyUSB*", "ttyACM*", "usbtmc*", "gpib*")
"""Device files behind which a GPIB adapter may sit (Linux)."""
SHORT = SweepPlan((Segment(1e6, 2e6, 11),), oscillator_V=0.1, bandwidth=1)
"""A sweep that harms nothing and lasts some hundredths of a second."""


@dataclass(frozen=True)
class Check:
    """One thing that was looked at."""

    name: str
    status: Status
    """`note` is worth knowing and stops nothing; with a `fault`, something that pzctl needs does not work."""
    says: str
    remedy: str = ""
    """What to do about it."""


def checkup(resource: str | None = None, heard: Callable[[str], None] = lambda _: None) -> list[Check]:
    """Look at everything and return what was found; nothing raises. `heard` is told what is looked at.

    `resource`: an analyzer that is to be asked who it is, and to sweep; without it, instruments are searched.
    """
    heard("this machine")
    found = [_software(), _folder(), _journal(), _daemon()]
    heard("devices and VISA libraries")
    found += _devices(Path("/dev"))
    found += _instrument(resource) if resource else _instruments(discover())
    heard("a measurement on the simulated bench, through every part")
    return [*found, _rehearsal()]


def _software() -> Check:
    try:
        words = ", ".join(f"{name} {version(name)}" for name in NEEDED)
    except PackageNotFoundError as error:
        return Check("software", "fault", f"{error.name} is not installed", "install pzctl anew with pip")
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
    if free < ENOUGH_BYTES:
        return Check("data folder", "note", f"{folder}: only {free / 1e6:.0f} MB are free", "make room on this disk")
    return Check("data folder", "ok", f"{folder}, {free / 1e9:.1f} GB free")


def _journal() -> Check:
    try:
        archive = open_journal()
        try:
            wrong, events = archive.verify(), archive.size
        finally:
            archive.close()
    except NoSamplesError:
        return Check("journal", "ok", "empty: nothing was measured yet")
    except PzctlError as error:
        return Check("journal", "fault", str(error), "bring back the folder from a backup, or move it away")
    if wrong:
        return Check("journal", "fault", f"{len(wrong)} of {events} events are damaged: {wrong[0]}", "see the disk")
    return Check("journal", "ok", f"{events} events, each array compared with its hash")


def _daemon() -> Check:
    where = find(home())
    if where is None:
        return Check("daemon", "ok", "none runs; `pzctl measure` starts one")
    return Check("daemon", "ok", f"runs as process {where.pid} and owns {where.resource}")


def _devices(folder: Path) -> list[Check]:
    """Return a note for each adapter's device file that this user may not open."""
    there = sorted(path for pattern in DEVICES for path in folder.glob(pattern))
    return [
        Check(
            "permission",
            "note",
            f"{path} is there, and you may not read and write it",
            f"join its group: sudo usermod -aG {_group(path)} $USER, then log in again",
        )
        for path in there
        if not os.access(path, os.R_OK | os.W_OK)
    ]


def _group(path: Path) -> str:
    try:
        return path.group()
    except (KeyError, OSError):
        return "dialout"


def _instruments(discovery: Discovery) -> list[Check]:
    found = [
        Check("instrument", "ok" if one.idn else "note", f"{one.resource}: {one.idn or one.says}")
        for one in discovery.found
    ]
    if not any(one.idn for one in discovery.found):
        says, remedy = "none answered", "name it: pzctl doctor --resource HOST:5025; see docs/connecting-a-4294A.md"
        found.append(Check("instrument", "note", says, remedy))
    return found + [Check("not looked at", "note", what) for what in discovery.not_scanned]


def _instrument(resource: str) -> list[Check]:
    """Ask who is there, and take a short and weak sweep: every part of the path is used. A daemon's is left to it."""
    where = find(home())
    if where is not None and where.resource == resource:
        return [Check("instrument", "ok", f"{resource} is the daemon's, and was not touched; ask `pzctl status`")]
    try:
        analyzer = open_analyzer(resource)
        try:
            identity = analyzer.identify()
            found = [Check("instrument", "ok", f"{identity.name}: {identity.idn}")]
            if isinstance(analyzer, Agilent4294A):
                found.append(_path(analyzer))
        finally:
            analyzer.close()
    except PzctlError as error:
        return [Check("instrument", "fault", str(error), "see docs/connecting-a-4294A.md")]
    return found


def _path(analyzer: Agilent4294A) -> Check:
    begun = time.monotonic()
    (sweep,) = analyzer.measure(SHORT)
    told = "by its service request" if analyzer.hears_requests else "by asking for the status byte"
    says = f"{sweep.frequency.size} points swept and read in {time.monotonic() - begun:.1f} s, settings read back"
    return Check("path", "note" if sweep.notes else "ok", "; ".join((says, f"its end is told {told}", *sweep.notes)))


def _rehearsal() -> Check:
    """Measure and fit the simulated disk through daemon, VISA, journal, sockets and fitter, in a folder of its own."""
    from ..client.client import connect
    from ..files.builds.build_file import THESIS_BUILD, read_build
    from ..files.daemon_options import DaemonOptions
    from .launch import start

    begun = time.monotonic()
    build = read_build(THESIS_BUILD)
    try:
        with _own_folder():
            where = start(DaemonOptions(fitters=("mason",), simulator={"time_scale": 0.0}))
            with connect(where.events, where.requests) as lab:
                try:
                    measurement = lab.measure(build, "disk")
                    fitted = lab.wait_fit("mason", measurement.id).constants["disk.c33D"]
                    true = float(lab.bench({"command": "truth"})["constants"]["disk.c33D"]["re"])
                finally:
                    lab.shutdown()
    except (PzctlError, OSError) as error:
        return Check("rehearsal", "fault", str(error), "if you see nothing wrong here, this is a defect of pzctl")
    off = abs(fitted.re - true) / (fitted.u_re or true)
    says = (
        f"a simulated disk measured, kept, published and fitted in {time.monotonic() - begun:.1f} s; "
        f"c33D is {off:.1f} standard uncertainties from the truth"
    )
    if off > 4:
        return Check("rehearsal", "fault", says, "this is a defect of pzctl")
    return Check("rehearsal", "ok", says)


@contextmanager
def _own_folder() -> Generator[None]:
    """Work in a data folder of one's own, which is removed afterwards."""
    with (
        tempfile.TemporaryDirectory(prefix="pzctl-doctor-", ignore_cleanup_errors=True) as folder,
        in_folder(Path(folder)),
    ):
        yield
