"""Commands that speak with the instrument themselves: nobody else may do so in the meantime."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from ....drivers.agilent4294a import Agilent4294A


@contextmanager
def own_4294a(given: str | None) -> "Generator[Agilent4294A]":
    """Give the 4294A at the resource `given`, or else configured, asked who it is, and let go of it afterwards.

    Raises DaemonError where a daemon of this user owns it, UsageError where none is named, or it is a recording,
    ConfigError, InstrumentError.
    """
    from ....drivers import open_analyzer
    from ....drivers.agilent4294a import Agilent4294A
    from ...client.location import same_resource
    from ...client.protocol import DaemonError
    from ...files.config import settings
    from ...server.launch import running

    resource = settings({"resource": given}).get("resource")
    if resource is None:
        raise UsageError("no instrument is named: give --resource, set PZCTL_RESOURCE, or write it into config.toml")
    place = running()
    if place is not None and same_resource(resource, place.resource):
        raise DaemonError(f"the daemon that runs owns {resource}; end it with `pzctl daemon --stop`", "owner")
    analyzer = open_analyzer(resource)
    try:
        if not isinstance(analyzer, Agilent4294A):
            raise UsageError(f"--resource {resource}: a recording has no fixture and no screen; name an instrument")
        analyzer.identify()
        yield analyzer
    finally:
        analyzer.close()
