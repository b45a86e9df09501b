"""From a typed resource to an instrument, or to one clear sentence."""

import contextlib
import socket

import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.drivers.visa import resources as visa
from pzctl.drivers.visa.resources import resource_name


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("127.0.0.1:5025", "TCPIP0::127.0.0.1::5025::SOCKET"),
        ("analyzer.lab:5025", "TCPIP0::analyzer.lab::5025::SOCKET"),
        ("TCPIP0::10.0.0.7::5025::SOCKET", "TCPIP0::10.0.0.7::5025::SOCKET"),
        (" GPIB0::17::INSTR ", "GPIB0::17::INSTR"),
        ("TCPIP0::10.0.0.7::gpib0,17::INSTR", "TCPIP0::10.0.0.7::gpib0,17::INSTR"),
        ("USB0::0x2A8D::0x5F01::MY52100123::INSTR", "USB0::0x2A8D::0x5F01::MY52100123::INSTR"),
        ("PROLOGIX::10.0.0.7::17", "PROLOGIX::10.0.0.7::17"),
        ("PROLOGIX::/dev/ttyUSB0::17", "PROLOGIX::/dev/ttyUSB0::17"),
    ],
)
def test_valid_resources(given, name):
    assert resource_name(given) == name


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("", "resource ''.*GPIB0::17::INSTR"),
        ("the 4294A", "resource 'the 4294A': not an instrument's address; allowed are GPIB0::17::INSTR"),
        ("host:70000", "port 70000 does not exist; 1 to 65535"),
        ("GPIB0::31::INSTR", "GPIB address 31 does not exist; 0 to 30"),
        ("PROLOGIX::/dev/no-such-port::17", r"PRLGX-ASRL0::/dev/no-such-port::INTFC: "),
        ("ASRL1::INSTR", "not an instrument's address"),
    ],
)
def test_what_is_none(given, words):
    with pytest.raises(InstrumentError, match=words):
        open_analyzer(given)


def test_nobody_listens():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(InstrumentError, match=rf"nothing listens there \(connection refused\).*the port {port}"):
        open_analyzer(f"127.0.0.1:{port}")


def test_a_connection_that_is_not_accepted(monkeypatch):
    monkeypatch.setattr(visa, "OPEN_SECONDS", 0.3)
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(socket.socket())
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        for _ in range(3):  # more than the backlog: the next one is kept waiting
            client = stack.enter_context(socket.socket())
            client.setblocking(False)
            client.connect_ex(server.getsockname())
        with pytest.raises(InstrumentError, match=r"no answer within 0\.3 s; is 127\.0\.0\.1 switched on"):
            open_analyzer(f"127.0.0.1:{server.getsockname()[1]}")


def test_unknown_host():
    with pytest.raises(InstrumentError, match=r"host no-such-analyzer\.invalid is unknown"):
        open_analyzer("no-such-analyzer.invalid:5025")


def test_an_instrument_that_does_not_answer(play):
    peer = play({"*IDN?": [b""]})
    with pytest.raises(InstrumentError, match=r"no answer to \*IDN\? within 0.4 s"):
        open_analyzer(peer.resource, timeout_seconds=0.4)


def test_gpib_without_a_library_names_the_package_to_install():
    with pytest.raises(InstrumentError, match="GPIB cannot be used here"):
        open_analyzer("GPIB0::17::INSTR")
