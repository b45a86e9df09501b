"""Other clients of a 4294A: pymeasure's driver, pyvisa, a plain `nc`, a connection for every command."""

import math
import socket
import struct

import numpy as np
import pytest
import pyvisa


@pytest.fixture
def visa():
    manager = pyvisa.ResourceManager("@py")
    yield manager
    manager.close()


def test_pymeasure_drives_it(lab_with, tmp_path):
    lab = lab_with(time_scale=0.002)
    from pymeasure.instruments.agilent import (
        Agilent4294A,
    )  # imported late: it takes half a second, in each process of a test run

    analyzer = Agilent4294A(lab.sim.resource, visa_library="@py")
    try:
        analyzer.reset()
        assert analyzer.id == "HEWLETT-PACKARD,4294A,MY43202956,REV1.11"
        for setting in ("SWPT LIN", "BWFACT 5", "MEAS IMPH", "POWE 0.5"):
            analyzer.write(setting)
        analyzer.start_frequency, analyzer.stop_frequency, analyzer.num_points = 1e6, 6e6, 401
        analyzer.active_trace, analyzer.title = "B", "disk"
        assert (analyzer.start_frequency, analyzer.stop_frequency, analyzer.num_points) == (1e6, 6e6, 401)
        assert analyzer.title == '"disk"'
        analyzer.write("SING")
        assert analyzer.complete == "1"
        data = analyzer.get_data(str(tmp_path / "sweep"))
        picture = analyzer.save_graphics(str(tmp_path / "screen"))
        assert analyzer.active_trace == "B"
        assert analyzer.ask("OUTPERRO?").startswith("0,")
    finally:
        analyzer.adapter.close()
        analyzer.adapter.manager.close()
    np.testing.assert_allclose(data["Frequency"], np.linspace(1e6, 6e6, 401))
    assert not data["A Imag"].any()
    assert not data["B Imag"].any()
    assert -91 < data["B Real"][0] < -85, "capacitive below the resonance"
    assert data["A Real"].max() / data["A Real"].min() > 50, "a resonance and an antiresonance"
    content = (tmp_path / picture).read_bytes()
    assert content[:4] == b"MM\0*"
    assert len(content) > 640 * 480, "all of it came, in blocks of 16384"


def test_pyvisa_reads_binary_blocks_and_stays_in_step(lab, visa):
    with visa.open_resource(lab.sim.resource, read_termination="\n", write_termination="\n") as link:
        link.write("*RST;STAR 1 MHZ;STOP 6 MHZ;POIN 801;FORM3;SING")
        assert link.query("*OPC?") == "1"
        pairs = link.query_binary_values("OUTPDATA?", "d", is_big_endian=True, container=np.array)
        assert pairs.shape == (1602,)
        assert link.query("POIN?") == "801"
        link.write("FORM5")
        small = link.query_binary_values("OUTPDATA?", "f", is_big_endian=False, container=np.array)
        np.testing.assert_allclose(small, pairs, rtol=1e-7)


def nc(port: int, script: str) -> bytes:
    """The output of `printf script | nc host port`."""
    with socket.create_connection(("127.0.0.1", port), 10) as link:
        link.sendall(script.encode())
        link.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: link.recv(65536), b""))


def test_a_plain_nc_script(lab_with):
    lab = lab_with(time_scale=0.01)
    answers = nc(
        lab.sim.port, "*RST\r\nSTAR 1 MHZ;STOP 6 MHZ\r\nPOIN 5\r\nSING\r\n*OPC?\r\nOUTPSWPRM?\r\nOUTPERRO?\r\n"
    )
    opc, axis, error = answers.decode().splitlines()
    assert (opc, error) == ("1", '0,"No error"')
    assert [float(x) for x in axis.split(",")] == [1e6, 2.25e6, 3.5e6, 4.75e6, 6e6]


def test_a_connection_for_every_command(lab):
    for command in ("*RST", "POIN 11", "STAR 2 MHZ", "SING"):
        nc(lab.sim.port, command + "\n")
    assert nc(lab.sim.port, "POIN?\n") == b"11\n"


def test_the_raw_socket_way_of_reading_eight_bytes_of_header(lab):
    with socket.create_connection(("127.0.0.1", lab.sim.port), 10) as link, link.makefile("rb") as stream:
        link.sendall(b"*RST\nFORM2\nPOIN 3\nSING\n*OPC?\nMEAS COMP\nOUTPDTRC?\n*IDN?\n")
        assert stream.readline() == b"1\n"
        head = stream.read(8)
        (first, *_) = struct.unpack(">6f", stream.read(int(head[2:])))
        assert math.isfinite(first)
        assert stream.readline() == b"\n"
        assert stream.readline().startswith(b"HEWLETT")
