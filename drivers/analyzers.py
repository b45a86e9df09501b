"""Finding the analyzers that are installed: the entry point group `pzctl.analyzers`."""

from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points

from .base.analyzer import Analyzer, InstrumentError
from .base.capabilities import Capabilities
from .base.driver import Driver, InstrumentDriver, PrefixDriver
from .visa import replies
from .visa.resources import open_session, resource_name

GROUP = "pzctl.analyzers"


def open_analyzer(resource: str, timeout_seconds: float = 5.0) -> Analyzer:
    """Return the analyzer behind `resource` (see `resources.ALLOWED`), by its prefix or by its answer to `*IDN?`.

    `timeout_seconds`: how long a single answer may take; the wait for a sweep is computed from the plan.
    Raises InstrumentError: not a resource, unknown host, refused, nobody there, no VISA library for it, an
    identification that no installed analyzer has.
    """
    text = resource.strip()
    for driver in _working():
        if isinstance(driver, PrefixDriver) and text.startswith(driver.prefix):
            return driver.open(text.removeprefix(driver.prefix))
    from .visa.connection import Connection

    name = resource_name(resource)
    link = Connection(text, lambda: open_session(name), timeout_seconds)
    try:
        return _identified(text, link.ask("*IDN?").strip()).open(link)
    except BaseException:
        link.close()
        raise


def capabilities_of(idn: str) -> Capabilities:
    """Return what the analyzer that answers `*IDN?` with `idn` can do; of one that nobody knows, what is assumed.

    Raises InstrumentError where pzctl is not installed as it should be.
    """
    instruments = [driver for driver in _working() if isinstance(driver, InstrumentDriver)]
    for driver in instruments:
        if driver.idn.fullmatch(idn.strip()):
            return driver.capabilities(idn.strip())
    return next(driver for driver in instruments if driver.assumed).capabilities("")


def _identified(resource: str, idn: str) -> InstrumentDriver:
    for driver in _working():
        if isinstance(driver, InstrumentDriver) and driver.idn.fullmatch(idn):
            return driver
    raise InstrumentError(f"{resource}: *IDN? is answered by {replies.quote(idn)}; {_known()}")


def _known() -> str:
    """Return which analyzers are installed, as a clause."""
    drivers = list(_drivers())
    broken = [driver for driver in drivers if isinstance(driver, str)]
    names = [driver.name for driver in drivers if not isinstance(driver, str)]
    return "; ".join([f"known are {', '.join(names)}", *broken])


def _working() -> list[Driver]:
    """Return those that load. Raises InstrumentError where pzctl's own are not among them."""
    working = [driver for driver in _drivers() if not isinstance(driver, str)]
    if not any(isinstance(driver, InstrumentDriver) and driver.assumed for driver in working):
        raise InstrumentError(f"no analyzer of pzctl's own is registered ({GROUP}); reinstall pzctl with pip")
    return working


def _drivers() -> Iterator[Driver | str]:
    """Yield each installed driver, by the names of their entry points; for one that does not load, why, as a clause."""
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        try:
            driver = point.load()
        except Exception as error:  # one that does not load leaves the others alone
            yield f"{point.name} of {_package(point)} does not load: {error}"
            continue
        if isinstance(driver, InstrumentDriver | PrefixDriver):
            yield driver
        else:
            yield f"{point.name} of {_package(point)} is no driver, but {type(driver).__name__}"


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else "an unknown package"
