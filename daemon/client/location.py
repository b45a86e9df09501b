"""How a daemon is found: a small file in the data folder that says who runs and where it can be reached."""

from pathlib import Path

import msgspec

from ..files.paths import daemon_file, home, journal_folder
from ..journal.folder_lock import is_written
from ..wire.curve_keys import ClientKey, read_client_key, write_secret
from ..wire.frames import WireError, from_json, to_json
from .protocol import DaemonError


class Location(msgspec.Struct, frozen=True):
    """Where the daemon of a data folder can be reached; the content of `daemon.json`."""

    pid: int
    run: str
    version: str
    events: str
    requests: str
    resource: str
    bench: str | None
    log: str
    journal: str | None = None
    """URL of its journal; None where that is in the data folder."""
    station: str = ""
    """What it is called in that journal."""
    key: ClientKey | None = None
    """CURVE key of this account's programs."""


def same_resource(one: str, other: str) -> bool:
    """Return whether two resource strings name the same instrument: `HOST:PORT` is short for `TCPIP0::HOST::...`."""
    from ...drivers.base.analyzer import InstrumentError
    from ...drivers.visa.resources import resource_name

    try:
        return one == other or resource_name(one) == resource_name(other)
    except InstrumentError:  # a recording has one name only
        return False


def announce(folder: Path, location: Location) -> None:
    """Write the file, whole or not at all, for its owner alone."""
    path = daemon_file(folder)
    part = path.with_suffix(".part")
    part.unlink(missing_ok=True)
    write_secret(part, to_json(location))
    part.replace(path)


def withdraw(folder: Path) -> None:
    """Remove the file."""
    daemon_file(folder).unlink(missing_ok=True)


def find(folder: Path) -> Location | None:
    """Return where the daemon is, or None where none runs; a file left by a killed one counts for nothing."""
    try:
        location = from_json(daemon_file(folder).read_bytes(), _location)
    except (FileNotFoundError, WireError):
        return None
    return location if is_written(journal_folder(folder)) else None


def locate() -> Location:
    """Return where the daemon of this user's data folder is. Raises DaemonError where none runs."""
    location = find(home())
    if location is None:
        raise DaemonError(f"no daemon runs on the data folder {home()}; start one with `pzctl daemon`", "no-daemon")
    return location


def address(events: str | None, requests: str | None, key: str | Path | None) -> tuple[str, str, ClientKey | None]:
    """Return where a daemon is and the key that lets in: what is given, else of the one that runs here.

    Raises DaemonError where none runs, KeyFileError where the key cannot be used.
    """
    if events is not None and requests is not None:
        own = read_client_key(Path(key)) if key is not None else None
        place = find(home()) if own is None else None
        if place is not None and (place.events == events or place.requests == requests):
            own = place.key
        return events, requests, own
    own = read_client_key(Path(key)) if key is not None else None
    place = locate()
    return events or place.events, requests or place.requests, own or place.key


_location = msgspec.json.Decoder(Location)
