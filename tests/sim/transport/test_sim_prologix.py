"""The GPIB adapter: `++` commands, serial poll, service request, and pyvisa-py's driver for it."""

import time

import numpy as np
import pytest
import pyvisa


@pytest.fixture
def bus(lab_with):
    lab = lab_with(prologix_port=0, time_scale=0.02)
    return lab, lab.wire(lab.sim.prologix_port)


def poll(wire):
    return int(wire.ask("++spoll").strip())


def wait_for_request(wire):
    until = time.monotonic() + 60
    while wire.ask("++srq").strip() == "0":
        assert time.monotonic() < until
        time.sleep(0.005)


def test_the_adapter_answers_for_itself(bus):
    _, wire = bus
    assert "GPIB-ETHERNET" in wire.ask("++ver")
    assert wire.ask("++addr").strip() == "17"
    wire.say("++read_tmo_ms 99999")
    assert wire.ask("++read_tmo_ms").strip() == "3000"
    assert "Unrecognized" in wire.ask("++dance")


def test_a_sweep_by_service_request_as_the_manual_does_it(bus):
    _, wire = bus
    wire.say("*RST;STAR 1 MHZ;STOP 6 MHZ;BWFACT 3;FORM3")
    wire.say("TRGS INT;ESNB 1;*SRE 4;*CLS;SING")
    assert poll(wire) == 0
    wait_for_request(wire)
    assert poll(wire) == 64 | 4
    assert poll(wire) == 4, "the poll cleared the request; the event stays"
    wire.say("OUTPDATA?")
    wire.say("++read eoi")
    assert wire.stream.read(8) == b"#6003216"
    assert len(wire.stream.read(3217)) == 3217


def test_compensation_says_when_it_is_done(bus):
    _, wire = bus
    wire.say("*RST;CALP USER;ESNB 256;*SRE 4;*CLS;COMB")
    wait_for_request(wire)
    wire.say("ESB?")
    assert wire.ask("++read eoi") == "256"


def test_a_read_times_out_during_opc_but_the_status_byte_can_be_polled(bus):
    _, wire = bus
    wire.say("++read_tmo_ms 1")
    wire.say("*RST;*CLS;*SRE 16;BWFACT 5;POIN 51;STAR 1 MHZ;STOP 2 MHZ;SING;*OPC?")
    wire.say("++read eoi")
    assert poll(wire) & 16 == 0, "nothing was received, and no answer is ready"
    wait_for_request(wire)
    assert poll(wire) == 64 | 16
    assert wire.ask("++read eoi") == "1"


def test_an_answer_nobody_read_and_a_read_nobody_asked_for_are_query_errors(bus):
    _, wire = bus
    wire.say("++read_tmo_ms 1000")
    wire.say("*CLS")
    assert poll(wire) == 0
    wire.say("*IDN?")
    while not poll(wire) & 16:
        time.sleep(0.005)
    wire.say("OUTPERRO?")
    assert wire.ask("++read eoi").startswith("-410,")
    wire.say("++read_tmo_ms 1")
    wire.say("++read eoi")
    wire.say("++read_tmo_ms 1000")
    wire.say("OUTPERRO?")
    assert wire.ask("++read eoi").startswith("-420,")


def test_device_clear_ends_a_blocking_command(bus):
    _, wire = bus
    wire.say("*RST;TRGS BUS;SING;*OPC?")
    wire.say("++clr")
    wire.say("POIN?")
    assert wire.ask("++read eoi") == "201"


def test_no_instrument_answers_at_another_address(bus):
    _, wire = bus
    wire.say("++addr 4")
    wire.say("++read_tmo_ms 1")
    wire.say("*IDN?")
    wire.say("++read eoi")
    assert poll(wire) == 0


def test_pyvisa_reaches_it_by_its_gpib_address(bus):
    lab, _ = bus
    manager = pyvisa.ResourceManager("@py")
    adapter = manager.open_resource(f"PRLGX-TCPIP0::127.0.0.1::{lab.sim.prologix_port}::INTFC")
    link = manager.open_resource("GPIB0::17::INSTR")
    try:
        assert link.query("*IDN?").strip() == "HEWLETT-PACKARD,4294A,MY43202956,REV1.11"
        link.write("*RST;STAR 1.5E+6;STOP 6 MHZ;POIN 51;FORM3;ESNB 1;*CLS;SING")
        until = time.monotonic() + 60
        while not link.read_stb() & 4:
            assert time.monotonic() < until
        pairs = link.query_binary_values("OUTPDATA?", "d", is_big_endian=True, container=np.array)
        assert pairs.size == 102
        assert float(link.query("STAR?")) == 1.5e6, "the escaped + arrived"
    finally:
        link.close()
        adapter.close()
        manager.close()


def test_a_departed_client_does_not_receive_the_next_answers(bus):
    lab, wire = bus
    wire.say("++read_tmo_ms 3000")
    wire.say("*RST;TRGS BUS;SING;*OPC?")
    wire.say("++read eoi")
    wire.close()
    lab.wires.remove(wire)
    other = lab.wire(lab.sim.prologix_port)
    other.say("++read_tmo_ms 3000")
    other.say("++clr")
    other.say("*IDN?")
    assert other.ask("++read eoi").startswith("HEWLETT-PACKARD")
