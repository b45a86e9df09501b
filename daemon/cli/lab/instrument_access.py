"""Exclusive access to the instrument for the commands that use it without the daemon."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from ....drivers.base.analyzer import Analyzer


@contextmanager
def own_analyzer(given: str | None) -> "Generator[Analyzer]":
    """Open and identify the analyzer at the resource `given`, or else at the configured one; close it afterwards.

    Raises DaemonError if a daemon of this user owns it, UsageError if no resource is named, ConfigError,
    InstrumentError.
    """
    from ....drivers import open_analyzer
    from ...client.location import analyzer_at
    from ...client.protocol import DaemonError
    from ...files.config import settings
    from ...server.launch import running

    resource = settings({"resource": given}).get("resource")
    if resource is None:
        raise UsageError("no instrument is named: give --resource, set PZCTL_RESOURCE, or write it into config.toml")
    place = running()
    if place is not None and analyzer_at(place, resource) is not None:
        raise DaemonError(f"the running daemon owns {resource}; end it with `pzctl daemon --stop`", "owner")
    analyzer = open_analyzer(resource)
    try:
        analyzer.identify()
        yield analyzer
    finally:
        analyzer.close()
