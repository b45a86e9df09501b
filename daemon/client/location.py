"""Where the daemon of a data folder can be reached: the file `daemon.json` that it writes there."""

from pathlib import Path

import msgspec

from ..files.analyzer_options import ONLY
from ..files.paths import daemon_file, home, journal_folder
from ..journal.stores.folder_lock import is_written
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
    analyzers: dict[str, str] = {}
    """The resource of each analyzer by its name; `resource` and `bench` are those of the first."""
    journal: str | None = None
    """URL of its journal; None if the journal is in the data folder."""
    station: str = ""
    """Name of this bench in that journal."""
    key: ClientKey | None = None
    """CURVE key for the programs of this user account."""


def analyzer_at(location: Location, resource: str) -> str | None:
    """Return the name of the daemon's analyzer with this resource, or None if it owns none."""
    from ...drivers.visa.resources import same_instrument

    owned = location.analyzers or {ONLY: location.resource}
    return next((name for name, own in owned.items() if own == resource or same_instrument(own, resource)), None)


def announce(folder: Path, location: Location) -> None:
    """Write the file atomically, readable by its owner only."""
    path = daemon_file(folder)
    part = path.with_suffix(".part")
    part.unlink(missing_ok=True)
    write_secret(part, to_json(location))
    part.replace(path)


def withdraw(folder: Path) -> None:
    """Remove the file."""
    daemon_file(folder).unlink(missing_ok=True)


def find(folder: Path) -> Location | None:
    """Return where the daemon is, or None if none runs; the file of a killed daemon is ignored."""
    try:
        location = from_json(daemon_file(folder).read_bytes(), _location)
    except (FileNotFoundError, WireError):
        return None
    return location if is_written(journal_folder(folder)) else None


def locate() -> Location:
    """Return where the daemon of this user's data folder is. Raises DaemonError if none runs."""
    location = find(home())
    if location is None:
        raise DaemonError(f"no daemon runs on the data folder {home()}; start one with `pzctl daemon`", "no-daemon")
    return location


def address(events: str | None, requests: str | None, key: str | Path | None) -> tuple[str, str, ClientKey | None]:
    """Return a daemon's two endpoints and the client's key; what is not given is that of the daemon that runs here.

    Raises DaemonError if none runs, KeyFileError if the key cannot be used.
    """
    if events is not None and requests is not None:
        client_key = read_client_key(Path(key)) if key is not None else None
        place = find(home()) if client_key is None else None
        if place is not None and (place.events == events or place.requests == requests):
            client_key = place.key
        return events, requests, client_key
    client_key = read_client_key(Path(key)) if key is not None else None
    place = locate()
    return events or place.events, requests or place.requests, client_key or place.key


_location = msgspec.json.Decoder(Location)
