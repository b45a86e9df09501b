"""One program at a time commands an instrument; the lock of a killed one blocks nobody."""

import os
import pwd
import re
import subprocess
import sys
from contextlib import closing

import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.drivers.visa.discover import identity_of
from pzctl.drivers.visa.instrument_lock import unit_of
from pzctl.drivers.visa.resources import address_of, resource_name
from pzctl.sim.server import SimOptions, running

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such lock")

HOLDS_IT = """
import sys
from pzctl.drivers.visa.instrument_lock import lock_instrument
lock = lock_instrument(sys.argv[1], "it")
print("locked", flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def sim():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0)) as simulator:
        yield simulator


def test_a_second_one_is_refused_however_it_writes_the_address(sim):
    name = f"localhost:{sim.resource.split('::')[2]}"
    me = re.escape(f"{name}: process {os.getpid()} of {pwd.getpwuid(os.getuid()).pw_name}")
    with closing(open_analyzer(sim.resource)) as first:
        with pytest.raises(InstrumentError, match=f"{me} uses this analyzer already; end that one first, or use it"):
            open_analyzer(name)
        assert "uses this analyzer already" in identity_of(sim.resource, 1.0)["error"], "doctor must not ask it"
        first._link.doubt()
        first.identify()  # by a new session
        with pytest.raises(InstrumentError, match="uses this analyzer already"):
            open_analyzer(name)
    open_analyzer(name).close()


def test_one_at_two_addresses_is_one_instrument(sim, monkeypatch):
    at = iter(("TCPIP0::192.0.2.17::5025::SOCKET", "GPIB0::17::INSTR", "GPIB0::17::INSTR"))
    monkeypatch.setattr("pzctl.drivers.analyzers.address_of", lambda name: next(at))
    with closing(open_analyzer(sim.resource)) as first:
        with pytest.raises(InstrumentError, match=f"process {os.getpid()} of .* uses this analyzer already"):
            open_analyzer(sim.resource)
        first.identify()
    open_analyzer(sim.resource).close()


def test_who_states_no_serial_number_is_known_by_its_address():
    assert unit_of('"KEYSIGHT, 4294A, my123,REV1.11"') == unit_of("HEWLETT-PACKARD,4294A,MY123,REV2") == "4294A MY123"
    assert [unit_of(idn) for idn in ("ACME,Z1,0,1.0", "ACME,Z1,,1.0", "ACME", "")] == [None] * 4


def test_an_analyzer_that_cannot_be_opened_is_released():
    for _ in range(2):
        with pytest.raises(InstrumentError, match="nothing listens there"):
            open_analyzer("127.0.0.1:1")


@pytest.mark.system
def test_the_lock_of_a_killed_program_blocks_nobody(sim):
    words = [sys.executable, "-P", "-c", HOLDS_IT, address_of(resource_name(sim.resource))]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"locked\n"
        with pytest.raises(InstrumentError, match=f"process {other.pid} of .* uses this analyzer already"):
            open_analyzer(sim.resource)
        other.kill()
        other.wait()
        open_analyzer(sim.resource).close()
