"""Finding the analyzers that are installed: the entry point group `pzctl.analyzers`."""

from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points

from .base.analyzer import Analyzer, InstrumentError
from .base.capabilities import Capabilities
from .base.driver import Driver, InstrumentDriver, PrefixDriver
from .visa import replies
from .visa.resources import address_of, open_session, resource_name

GROUP = "pzctl.analyzers"

_THIS_MACHINE = "::127."
"""In the address of a simulated analyzer; all of them have one serial number."""


def open_analyzer(resource: str, timeout_seconds: float = 5.0) -> Analyzer:
    """Open the analyzer at `resource` (see `resources.ALLOWED`), chosen by its prefix or by its answer to `*IDN?`.

    `timeout_seconds` limits a single answer; the wait for a sweep is computed from the plan. Raises InstrumentError for
    an invalid resource, an unknown host, a refused connection, no answer, a missing VISA library, an identification
    that no installed analyzer has, or an analyzer that another program uses.
    """
    text = resource.strip()
    for driver in _working():
        if isinstance(driver, PrefixDriver) and text.startswith(driver.prefix):
            return driver.open(text.removeprefix(driver.prefix))
    from .visa.connection import Connection

    name = resource_name(resource)
    address = address_of(name)
    connection = Connection(text, lambda: open_session(name), timeout_seconds, address)
    try:
        idn = connection.ask("*IDN?").strip()
        driver = _identified(text, idn)
        if _THIS_MACHINE not in address:
            connection.lock_unit(idn)
        return driver.open(connection)
    except BaseException:
        connection.close()
        raise


def capabilities_of(idn: str) -> Capabilities:
    """Return the capabilities of the analyzer that answers `*IDN?` with `idn`; for an unknown one, the assumed ones.

    Raises InstrumentError if pzctl's own analyzers are not installed.
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
    raise InstrumentError(f"{resource}: the answer to *IDN? is {replies.quote(idn)}; {_known()}")


def _known() -> str:
    """Return the installed analyzers as a clause for an error."""
    drivers = list(_drivers())
    broken = [driver for driver in drivers if isinstance(driver, str)]
    names = [driver.name for driver in drivers if not isinstance(driver, str)]
    return "; ".join([f"known are {', '.join(names)}", *broken])


def _working() -> list[Driver]:
    """Return the drivers that load. Raises InstrumentError if pzctl's own are not among them."""
    working = [driver for driver in _drivers() if not isinstance(driver, str)]
    if not any(isinstance(driver, InstrumentDriver) and driver.assumed for driver in working):
        raise InstrumentError(f"no analyzer of pzctl's own is registered ({GROUP}); reinstall pzctl with pip")
    return working


def _drivers() -> Iterator[Driver | str]:
    """Yield each installed driver by name of its entry point, or a clause with the reason if it does not load."""
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        try:
            driver = point.load()
        except Exception as error:  # a broken driver must not affect the others
            yield f"{point.name} of {_package(point)} does not load: {error}"
            continue
        if isinstance(driver, InstrumentDriver | PrefixDriver):
            yield driver
        else:
            yield f"{point.name} of {_package(point)} is not a driver but {type(driver).__name__}"


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else "an unknown package"
