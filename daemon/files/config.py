"""How a daemon is started: flags of the command line, then the environment, then the config file, then the defaults.

The file is `config.toml` in the data folder where PZCTL_HOME names one, else in the user's config folder:

    resource = "TCPIP0::192.168.0.17::5025::SOCKET"
    fitters = ["mason"]
    fit_seconds = 120
"""

import os
import socket
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import platformdirs

from ...fitters.data_folder import chosen_folder
from ...models.base.errors import PzctlError
from ...models.base.names import NameFault, among, check_name
from .auto_diagnosis import ASKED, AUTO
from .database_url import without_password
from .worker_limits import Limits

if TYPE_CHECKING:
    from .daemon_options import DaemonOptions

PREFIX = "PZCTL_"
"""Of the environment's variables: PZCTL_RESOURCE, PZCTL_FITTERS (separated by commas) ..."""


class ConfigError(PzctlError):
    """A setting that is not known, or not of the kind it should be."""


@dataclass(frozen=True)
class Setting:
    """One setting: what it may be, in words, and how it is read; `read` raises ValueError."""

    allowed: str
    read: Callable[[Any], Any]


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError
    return value


def _name(value: Any) -> str:
    return check_name(_text(value), "name")


def _names(value: Any) -> tuple[str, ...]:
    names = (name.strip() for name in value.split(",")) if isinstance(value, str) else value
    return tuple(_name(name) for name in names if name != "")


def _positive(value: Any) -> float:
    number = float(value)
    if not 0 < number < float("inf"):
        raise ValueError
    return number


def _not_negative(value: Any) -> float:
    number = float(value)
    if not 0 <= number < float("inf"):
        raise ValueError
    return number


def _host_port(value: Any) -> str:
    host, _, port = _text(value).rpartition(":")
    if not host or not host.isprintable() or not is_port(port) or port == "0":
        raise ValueError
    return value


def is_port(text: str) -> bool:
    """Return whether a text is the number of a TCP port; 0 is any free one."""
    return text.isascii() and text.isdecimal() and len(text) <= 5 and int(text) <= 65535


def _url(value: Any) -> str:
    if not _text(value).startswith(("postgresql://", "postgres://")):
        raise ValueError
    return value


def _when(value: Any) -> str:
    if value not in (AUTO, ASKED):
        raise ValueError
    return value


def _form(value: Any) -> str:
    if value not in ("text", "json"):
        raise ValueError
    return value


SETTINGS: Mapping[str, Setting] = {
    "resource": Setting("a VISA resource, or recording:FILE", _text),
    "events": Setting("a ZeroMQ endpoint", _text),
    "requests": Setting("a ZeroMQ endpoint", _text),
    "fitters": Setting("names of fitters, each of at most 64 characters that can be printed", _names),
    "bench": Setting("host:port, with a port from 1 to 65535", _host_port),
    "journal": Setting("a URL such as postgresql://USER@HOST/DATABASE", _url),
    "station": Setting("the name of this bench, at most 64 characters that can be printed", _name),
    "time_scale": Setting("a number from 0 up", _not_negative),
    "seed": Setting("a whole number", int),
    "max_bias_V": Setting("volts from 0 up", _not_negative),
    "max_oscillator_V": Setting("volts from 0 up", _not_negative),
    "compensation_days": Setting("days above 0", _positive),
    "fit_seconds": Setting("seconds above 0", _positive),
    "fit_memory_MB": Setting("megabytes above 0", lambda value: int(_positive(value))),
    "diagnose": Setting("auto or asked", _when),
    "log": Setting("text or json", _form),
}
"""All settings; each is a flag, a variable and a key of the file by this name."""


_LIMITS = ("max_bias_V", "max_oscillator_V", "compensation_days")
"""Of the bench."""


def config_file() -> Path:
    """Return where the config file is, be it there or not."""
    return (chosen_folder() or platformdirs.user_config_path("pzctl", appauthor=False)) / "config.toml"


def settings(flags: Mapping[str, Any]) -> dict[str, Any]:
    """Return every setting that is given anywhere; a flag that is None is not given.

    Raises ConfigError with the place, what was found and what is allowed.
    """
    path = config_file()
    merged: dict[str, Any] = {}
    for name, value in _read(path).items():
        merged[name] = _checked(name, value, f"{path}: {name}")
    for name in SETTINGS:
        variable = PREFIX + name.upper()
        if os.environ.get(variable):
            merged[name] = _checked(name, os.environ[variable], variable)
    for name, value in flags.items():
        if value is not None:
            merged[name] = _checked(name, value, f"--{name.replace('_', '-')}")
    return merged


def journal_of(found: Mapping[str, Any]) -> tuple[str | None, str]:
    """Return the URL of the journal, None for the data folder's own, and what this station is called in it."""
    url = found.get("journal")
    return url, found.get("station", socket.gethostname()) if url else ""


def options(found: Mapping[str, Any]) -> "DaemonOptions":
    """Return what a daemon is started with, of what `settings` returned."""
    from .daemon_options import DaemonOptions  # who only looks for the journal needs no daemon

    default = DaemonOptions()
    limits = Limits(
        seconds=found.get("fit_seconds", default.limits.seconds),
        memory_MB=found.get("fit_memory_MB", default.limits.memory_MB),
    )
    simulator = {"time_scale": found.get("time_scale", 1.0), "seed": found.get("seed", 0)}
    own = {
        name: found[name]
        for name in ("resource", "events", "requests", "fitters", "bench", "diagnose", *_LIMITS)
        if name in found
    }
    own["journal"], own["station"] = journal_of(found)
    return DaemonOptions(**own, simulator=simulator, limits=limits)


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: it cannot be read: {error}") from None


def _checked(name: str, value: Any, where: str) -> Any:
    if name not in SETTINGS:
        raise ConfigError(f"{where}: there is no such setting; {among(name, SETTINGS)}")
    try:
        return SETTINGS[name].read(value)
    except (ValueError, TypeError, NameFault):
        found = without_password(value) if isinstance(value, str) else value
        raise ConfigError(f"{where} is {found!r}; needed is {SETTINGS[name].allowed}") from None
