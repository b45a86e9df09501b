"""Discovery of instruments: the resources that VISA lists, their answers, and what could not be scanned.

Listing VISA resources may hang for ever, for example with a GPIB adapter on an instrument that is off. So it runs in a
child process with a time limit.
"""

import importlib.util
import json
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

from ..base.analyzer import InstrumentError
from .connection import Connection
from .resources import address_of, open_session, resource_name

LIBRARIES = {"@py": "pyvisa-py", "@ivi": "a vendor's VISA library"}

MISSING = {
    "psutil": "network cards other than the first one (pip install psutil)",
    "zeroconf": "instruments that announce themselves on the network (pip install zeroconf)",
    "serial": "serial ports, with Prologix adapters on them (pip install pyserial)",
    "gpib_ctypes": "GPIB cards without a vendor's VISA library (pip install gpib-ctypes, and linux-gpib)",
}
"""What pyvisa-py does not list if a module is not installed."""

# The programs of the child processes; each prints one JSON object.
_LIST = """
import json, sys, warnings
warnings.simplefilter("ignore")
try:
    from pyvisa import ResourceManager
    print(json.dumps({"found": list(ResourceManager(sys.argv[1]).list_resources("?*"))}))
except Exception as error:
    print(json.dumps({"error": " ".join(str(error).split()) or type(error).__name__}))
"""
_ASK = """
import json, sys
from pzctl.drivers.visa.discover import identity_of
print(json.dumps(identity_of(sys.argv[1], float(sys.argv[2]))))
"""

STARTING_SECONDS = 10.0
"""Additional seconds for a child process to start and to open a session."""


@dataclass(frozen=True)
class FoundResource:
    """One resource that VISA lists."""

    resource: str
    idn: str
    """The answer to `*IDN?`; "" if there was none."""
    says: str
    """Why there was no answer; "" if there was one."""


@dataclass(frozen=True)
class Discovery:
    """The resources found, and what was not scanned."""

    found: tuple[FoundResource, ...]
    not_scanned: tuple[str, ...]
    """One clause for each, with the remedy."""


def discover(list_seconds: float = 10.0, answer_seconds: float = 2.0) -> Discovery:
    """Look for instruments; never hang and never raise, but report failures in the result.

    No VISA library can list an instrument on a raw network socket; its address has to be given.
    """
    resources: list[str] = []
    skipped = ["raw sockets: name the analyzer's address, as HOST:5025"]
    for library, words in LIBRARIES.items():
        listed = _in_child(_LIST, [library], list_seconds)
        if "found" in listed:
            resources += [name for name in listed["found"] if name not in resources]
        else:
            skipped.append(f"resources of {words}: {listed['error'].rstrip(': ')}")
    skipped += [what for module, what in MISSING.items() if importlib.util.find_spec(module) is None]
    return Discovery(tuple(_identified(name, answer_seconds) for name in resources), tuple(skipped))


def identity_of(resource: str, seconds: float) -> dict[str, str]:
    """Return `{"idn": ...}`, or `{"error": ...}` with one sentence. Call it in a child process, as it may hang."""
    try:
        name = resource_name(resource)
        connection = Connection(resource, lambda: open_session(name), seconds, address_of(name))
    except InstrumentError as error:
        return {"error": str(error)}
    try:
        return {"idn": connection.ask("*IDN?").strip()}
    except InstrumentError as error:
        return {"error": str(error)}
    finally:
        connection.close()


def _identified(resource: str, seconds: float) -> FoundResource:
    """Ask for the identity, but only where a 4294A can be, since a query may disturb other devices."""
    try:
        resource_name(resource)
    except InstrumentError:
        return FoundResource(resource, "", "skipped: not a 4294A port")
    answer = _in_child(_ASK, [resource, str(seconds)], seconds + STARTING_SECONDS)
    return FoundResource(resource, answer.get("idn", ""), answer.get("error", ""))


def _in_child(program: str, arguments: list[str], seconds: float) -> dict[str, Any]:
    """Return the JSON object that `program` prints in a child process, or `{"error": ...}`.

    `-P` keeps the working directory out of the module search path, as folders of a checkout would hide modules.
    """
    command = [sys.executable, "-P", "-c", program, *arguments]
    try:
        done = subprocess.run(command, capture_output=True, timeout=seconds, check=False, text=True)  # noqa: S603
    except subprocess.TimeoutExpired:
        return {"error": f"no answer within {seconds:g} s; is an adapter connected to an instrument that is off?"}
    except OSError as error:
        return {"error": f"no process could be started: {error.strerror}"}
    try:
        return json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        last = (done.stderr.strip().splitlines() or ["nothing was printed"])[-1]
        return {"error": f"the search ended with {last}"}
