"""From bytes to commands: arbitrary bytes cause an instrument error at most."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.sim.bench.bench import Bench
from pzctl.sim.instrument.instrument import Instrument
from pzctl.sim.instrument.settings import TABLE
from pzctl.sim.language.commands import COMMANDS, QUERIES
from pzctl.sim.language.dialect import execute
from pzctl.sim.language.messages import MESSAGE_LIMIT, CommandError, Framer, Unit, parse

HEADERS = [*COMMANDS, *TABLE, "STAR", "STOP", "CENT", "SPAN", "POWE"]
HEADERS += [f"{name}?" for name in [*QUERIES, *TABLE, "STAR", "STOP", "CENT", "SPAN", "POWE"]]
PARAMETERS = ["ON", "OFF", "0", "-1", "2", "801", "1E9", "1E999", "nan", "1 MHZ", "0.5V", "LOG", "LIST", "OLEV", "DCB"]
PARAMETERS += ["BUS", "USER", "DOWN", "COMP", "CPD", "CURR", "B", '"a"', '"a.STA"', "'a.TXT'", "#14abcd", "1,2,3", ""]


def units(message):
    return list(parse(message))


def test_reads_common_messages():
    assert units(b"PRES;*CLS") == [Unit("PRES", False), Unit("*CLS", False)]
    assert units(b"spld on; meas imph ;trac?") == [
        Unit("SPLD", False, (b"on",)),
        Unit("MEAS", False, (b"imph",)),
        Unit("TRAC", True),
    ]
    assert units(b'TITL "a;b,\'c"') == [Unit("TITL", False, (b'"a;b,\'c"',))]
    assert units(b" ;; \r") == []


def test_a_newline_within_a_block_does_not_end_the_message():
    message = b"WRITE #213ab\ncd;efghijk"
    assert list(Framer().feed(message + b"\n*IDN?\r\n")) == [message, b"*IDN?"]
    assert units(message)[0].arguments == (b"#213ab\ncd;efghijk",)


@given(st.lists(st.binary(max_size=40)))
def test_framing_does_not_depend_on_how_the_bytes_arrive(pieces):
    whole, framer = list(Framer().feed(b"".join(pieces))), Framer()
    assert [m for piece in pieces for m in framer.feed(piece)] == whole


@given(st.binary(max_size=200))
def test_any_bytes_are_units_or_an_error(message):
    try:
        found = units(message)
    except CommandError:
        return
    assert all(u.mnemonic == u.mnemonic.upper() and u.mnemonic.isascii() for u in found)


def test_an_endless_message_is_dropped_and_the_next_is_read():
    framer = Framer()
    with pytest.raises(CommandError, match="Too much data"):
        list(framer.feed(b"x" * (MESSAGE_LIMIT + 1)))
    assert list(framer.feed(b"*IDN?\n")) == [b"*IDN?"]


@given(st.lists(st.tuples(st.sampled_from(HEADERS), st.sampled_from(PARAMETERS), st.sampled_from([0.0, 1e-3, 1e3]))))
def test_no_sequence_of_commands_breaks_the_instrument(sequence):
    now = [0.0]
    instrument = Instrument(Bench(), clock=lambda: now[0])
    for header, parameter, seconds in sequence:
        now[0] += seconds
        try:
            for unit in parse(f"{header} {parameter}".encode()):
                answer = execute(instrument, unit)
                assert not (answer and not unit.query), "only queries answer"
        except CommandError:
            continue
    assert execute(instrument, Unit("*IDN", True)) == b"HEWLETT-PACKARD,4294A,MY43202956,REV1.11"
