"""Faults on demand: each strikes once, at the chosen exchange."""

import numpy as np
import pytest

from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.bench.bench_errors import BenchError


def test_an_answer_is_cut_in_the_middle(lab):
    lab.bench("fault", kind="cut", at=2)
    wire = lab.wire(timeout=0.3)
    whole = wire.ask("*IDN?")
    wire.say("*IDN?")
    with pytest.raises(TimeoutError):
        wire.line()
    other = lab.wire()
    assert other.ask("*IDN?") == whole
    assert lab.bench("status")["struck"] == ["cut"]


def test_garbage_comes_before_an_answer(lab):
    wire = lab.wire()
    lab.bench("fault", kind="garbage")
    wire.say("*IDN?")
    raw = wire.stream.readline()
    assert raw.endswith(b"HEWLETT-PACKARD,4294A,MY43202956,REV1.11\n")
    assert not raw.startswith(b"HEWLETT")
    assert wire.ask("*IDN?").startswith("HEWLETT")


def test_a_block_counts_wrong(lab):
    wire = lab.wire()
    wire.say("*RST;POIN 11;FORM3")
    lab.bench("fault", kind="wrong-count", bytes=16)
    assert wire.ask("POIN?") == "11", "waits for an answer that has a count"
    wire.say("OUTPDATA?")
    assert wire.stream.read(8) == b"#6%06d" % (11 * 16 + 16)


def test_a_hang_blocks_all_clients_until_it_is_cleared(lab):
    wire, other = lab.wire(timeout=0.2), lab.wire(timeout=0.2)
    lab.bench("fault", kind="hang")
    for client in (wire, other):
        client.say("*IDN?")
        with pytest.raises(TimeoutError):
            client.line()
    lab.bench("fault", kind="none")
    assert lab.wire().ask("*IDN?").startswith("HEWLETT")


def test_a_message_is_swallowed(lab):
    wire = lab.wire()
    wire.say("POIN 11")
    wire.ask("POIN?")
    lab.bench("fault", kind="ignore")
    wire.say("POIN 22")
    assert wire.ask("POIN?") == "11"


def test_the_connection_is_lost_and_can_be_made_again(lab):
    wire = lab.wire()
    lab.bench("fault", kind="drop")
    wire.say("POIN 22;POIN?")
    assert wire.line() == ""
    assert lab.wire().ask("POIN?") == "22", "the message was carried out"


def test_power_fails_in_the_middle_of_a_sweep(lab_with):
    lab = lab_with(time_scale=0.05)
    wire = lab.wire()
    assert wire.ask("*RST;BWFACT 5;POIN 51;STAR 1 MHZ;STOP 2 MHZ;SING;POIN?") == "51"
    lab.bench("fault", kind="power-cycle", seconds=0.0)
    wire.say("*OPC?")
    assert wire.line() == "", "cut off without an answer"
    again = lab.wire()
    assert int(again.ask("*ESR?")) & 128
    assert again.ask("POIN?") == "201"
    assert lab.bench("status")["bench_seconds"] == 0, "the sweep never ended"


def test_a_front_panel_change_during_a_sweep(lab_with):
    lab = lab_with(time_scale=0.02)
    wire = lab.wire()
    assert wire.ask("*RST;*CLS;BWFACT 5;POIN 51;STAR 1 MHZ;STOP 2 MHZ;SING;POIN?") == "51"
    lab.bench("fault", kind="meddle", message="POIN 7")
    assert wire.ask("*OPC?") == "1", "the sweep begins anew and ends"
    assert wire.impedance().size == 7
    assert np.all(wire.impedance() != 0)
    assert int(wire.ask("*ESR?")) & 64, "user request"


def test_polarity_and_bias_overload_last_until_cleared(lab):
    wire = lab.wire()
    wire.say("*RST;STAR 1 MHZ;STOP 2 MHZ;SING")
    right = wire.impedance()
    lab.bench("fault", kind="polarity")
    lab.bench("fault", kind="bias-overload")
    wire.say("SING;DCO ON")
    np.testing.assert_allclose(wire.impedance(), -right, rtol=2e-3)
    assert wire.errors()[0].startswith("137,")
    lab.bench("fault", kind="none")
    wire.say("SING;DCO ON")
    assert wire.impedance()[0].imag < 0
    assert wire.errors() == []


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ({"kind": "gremlin"}, "no kind 'gremlin'"),
        ({"kind": "cut", "at": 0}, "counted from 1"),
        ({"kind": "cut", "at": 1.5}, "whole number"),
        ({"kind": "cut", "when": 3}, "no option 'when'"),
        ({}, "'kind' is None"),
    ],
)
def test_a_fault_that_makes_no_sense_is_refused(lab, command, sentence):
    with pytest.raises(BenchError, match=sentence):
        bench_command("127.0.0.1", lab.sim.bench_port, command="fault", **command)
