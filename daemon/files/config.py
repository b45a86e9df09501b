"""The daemon's settings. Precedence: command line, environment, config file, defaults.

The config file is `config.toml`, in the folder that PZCTL_HOME names or else in the user's config folder:

    resource = "TCPIP0::192.168.0.17::5025::SOCKET"
    fitters = ["mason"]
    fit_seconds = 120
"""

import os
import socket
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import platformdirs

from ...fitters.data_folder import chosen_folder
from ...models.base.errors import PzctlError
from ...models.base.names import NameFault, among, check_name
from .analyzer_options import AnalyzerOptions, read_analyzers
from .auto_diagnosis import ASKED, AUTO
from .backup_plan import read_backup
from .database_url import without_password
from .worker_limits import Limits

if TYPE_CHECKING:
    from .daemon_options import DaemonOptions

PREFIX = "PZCTL_"
"""Prefix of the environment variables: PZCTL_RESOURCE, PZCTL_FITTERS (separated by commas) ..."""


class ConfigError(PzctlError):
    """A setting that is not known, or whose value is not allowed."""


@dataclass(frozen=True)
class Setting:
    """One setting: its allowed values in words, and the function that reads it, which raises ValueError."""

    allowed: str
    read: Callable[[Any], Any]
    is_text: bool = True
    """Whether it can be given as text, by an environment variable."""


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
    """Return whether a text is a TCP port number, or 0 for any free port."""
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
    "analyzers": Setting(
        "a table for each name, with `resource` (default: a simulated 4294A), `max_bias_V` and `max_oscillator_V`",
        read_analyzers,
        is_text=False,
    ),
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
    "backup": Setting(
        "a table with `to` (a folder, or USER@HOST:FOLDER) and `every_hours` (a number of hours above 0)", read_backup
    ),
    "diagnose": Setting("auto or asked", _when),
    "readers": Setting("names of installed readers, each of at most 64 characters that can be printed", _names),
    "log": Setting("text or json", _form),
}
"""All settings; each name is a key of the config file, and mostly a flag and an environment variable."""


_OF_ONE = ("max_bias_V", "max_oscillator_V")
_LIMITS = (*_OF_ONE, "compensation_days")
"""Settings that belong to the bench."""


def config_file() -> Path:
    """Return the path of the config file, whether it exists or not."""
    return (chosen_folder() or platformdirs.user_config_path("pzctl", appauthor=False)) / "config.toml"


def settings(flags: Mapping[str, Any]) -> dict[str, Any]:
    """Return every setting that is given anywhere; a flag of None counts as not given.

    Raises ConfigError with the place, what was found and what is allowed.
    """
    path = config_file()
    merged: dict[str, Any] = {}
    for name, value in _read(path).items():
        merged[name] = _checked(name, value, f"{path}: {name}")
    for name, setting in SETTINGS.items():
        variable = PREFIX + name.upper()
        if setting.is_text and os.environ.get(variable):
            merged[name] = _checked(name, os.environ[variable], variable)
    for name, value in flags.items():
        if value is not None:
            merged[name] = _checked(name, value, f"--{name.replace('_', '-')}")
    return merged


def journal_of(given: Mapping[str, Any]) -> tuple[str | None, str]:
    """Return the URL of the journal (None: it is in the data folder) and the name of this station in it."""
    url = given.get("journal")
    return url, given.get("station", socket.gethostname()) if url else ""


def options(given: Mapping[str, Any]) -> "DaemonOptions":
    """Return the options of a daemon from the result of `settings`."""
    from .daemon_options import DaemonOptions  # not needed by programs that only read the journal

    default = DaemonOptions()
    limits = Limits(
        seconds=given.get("fit_seconds", default.limits.seconds),
        memory_MB=given.get("fit_memory_MB", default.limits.memory_MB),
    )
    simulator = {"time_scale": given.get("time_scale", 1.0), "seed": given.get("seed", 0)}
    chosen = {
        name: given[name]
        for name in ("resource", "events", "requests", "fitters", "bench", "backup", "diagnose", "analyzers", *_LIMITS)
        if name in given
    }
    if "analyzers" in chosen:
        _check_several(chosen["analyzers"], chosen)
        chosen.pop("resource", None)
    chosen["journal"], chosen["station"] = journal_of(given)
    if chosen["journal"] and "backup" in chosen:
        raise ConfigError(
            "backup: this copies a journal in the data folder; back up a PostgreSQL database with the server's own "
            "tools, or with `pzctl journal backup`"
        )
    return DaemonOptions(**chosen, simulator=simulator, limits=limits)


def _check_several(analyzers: Mapping[str, AnalyzerOptions], chosen: Mapping[str, Any]) -> None:
    """Raise ConfigError if two analyzers are one instrument, or another setting contradicts them."""
    from ...drivers.visa.resources import same_instrument

    named = {name: own.resource for name, own in analyzers.items() if own.resource is not None}
    for (first, one), (second, other) in combinations(named.items(), 2):
        if same_instrument(one, other):
            raise ConfigError(f"[analyzers]: {first} and {second} are the same instrument, {other}; it needs one table")
    for name in ("bench", *_OF_ONE):
        if name in chosen:
            raise ConfigError(f"{name}: this is the setting of a single analyzer; with [analyzers] each has its own")
    resource = chosen.get("resource")
    if resource is not None and not any(same_instrument(resource, own) for own in named.values()):
        there = ", ".join(f"{name} ({own.resource or 'simulated'})" for name, own in analyzers.items())
        raise ConfigError(f"resource {resource!r}: it is none of [analyzers], which are {there}; give it a table there")


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from None


def _checked(name: str, value: Any, where: str) -> Any:
    if name not in SETTINGS:
        raise ConfigError(f"{where}: no such setting; {among(name, SETTINGS)}")
    try:
        return SETTINGS[name].read(value)
    except (ValueError, TypeError, NameFault):
        shown = without_password(value) if isinstance(value, str) else value
        raise ConfigError(f"{where} is {shown!r}; allowed is {SETTINGS[name].allowed}") from None
