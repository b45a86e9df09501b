"""Every mnemonic of the programming manual's command reference, through the socket."""

import pytest

from pzctl.sim.language.command_table import ROWS, Row
from pzctl.sim.language.commands import COMMANDS, QUERIES
from pzctl.sim.language.kept_commands import short_tree

SETTINGS = [row for row in ROWS.values() if row.kind in ("switch", "token", "int", "real") and row.query == "also"]
NEEDS = {
    "list": "SADD;STOP 1 MHZ;SDON;SADD;STOP 2 MHZ;SDON;EDITDONE;SWPT LIST",
    "list-span": "",
    "marker": "MKR ON",
    "memory": "SING;DATMEM",
    "memory-shown": "SING;DATMEM;DISP DATM",
    "phase": "TRAC B",
    "scalar": "",
}
"""Commands that make each condition hold."""


def test_the_table_equals_the_manuals() -> None:
    assert len(ROWS) == 455
    unknown = [
        f"{row.mnemonic}{'?' * asks}"
        for row in ROWS.values()
        for asks, table in ((False, COMMANDS), (True, QUERIES))
        if row.query != ("none" if asks else "only")
        and row.mnemonic != "*STB"
        and short_tree(row.mnemonic) not in table
        and row.mnemonic not in table
        and not is_setting(row)
    ]
    assert unknown == []


def is_setting(row: Row) -> bool:
    return row.kind in ("switch", "token", "int", "ints", "text", "real") or row.mnemonic in (
        *("STAR", "STOP", "CENT", "SPAN", "POWE"),
    )


def test_every_setting_has_its_default_and_keeps_set_values(wire) -> None:
    wire.say("HOLD")
    for row in SETTINGS:
        wire.say("*RST;*CLS;" + ";".join(NEEDS[need] for need in row.needs if need in NEEDS))
        first = wire.ask(f"{row.mnemonic}?")
        assert first == initial(row) or float(first) == float(initial(row)), row.mnemonic
        for value, answer in examples(row):
            got = wire.ask(f"{row.mnemonic} {value};{row.mnemonic}?")
            assert got == answer or float(got) == pytest.approx(float(answer), rel=1e-12), (row.mnemonic, value)
        assert wire.errors() == [], row.mnemonic


def initial(row: Row) -> str:
    return {"ON": "1", "OFF": "0"}[row.initial] if row.kind == "switch" else row.initial


def examples(row: Row) -> list[tuple[str, str]]:
    """Sent and expected values: every token, both ends of a range, and values beyond them."""
    if row.kind == "switch":
        return [("ON", "1"), ("0", "0")]
    if row.kind == "token":
        special = {"SWPT": ["LIN", "LOG"], "TRAC": ["A"]}
        return [(t, t) for t in special.get(row.mnemonic, row.rest.split("|"))]
    low, high = row.rest.split()[:2]
    if row.kind == "int":
        return [(low, low), (high, high), (str(int(high) + 1), high)]
    return [(low, low), (high, high), (f"{float(high) * 2}", high)]


def test_queries_without_a_command_form(wire) -> None:
    for row in ROWS.values():
        if row.query == "only" and not row.mnemonic.startswith(":"):
            wire.say(row.mnemonic)
            assert wire.errors() == ['-113,"Undefined header"'], row.mnemonic


def test_a_condition_that_does_not_hold_has_its_error(wire) -> None:
    expected = {
        "MKRL ON": 98, "ZMAPER 5": 98, "EXPP ON": 87, "SEARNG FULL": 132, "ANAOMEMO": 34, "OUTCIO 3": 142,
        "SEAR": 98, "MKRCENT": 98, "MKRDSPAN": 99, "DMKRVAL 3": 99, "WIDSOUT": 101, "SEGMNUM 1": 132, "PORE ON": 12,
        "DISP MEMO": 34, "FMT POLA": 86, "MEAS COMP;FMT LINY": 85, "MKRMON ACV": 140, "MKRMON DCV": 139,
        "SETCDATE 2001,2,30": 154, "THRR 9.95E37": -222, "DCALOPENC 5 F": -131, "LIMSADD;LIMSADD": 75,
        "ADDRIP 1,2,3": -109, "OUTPMEMO?": 34,
    }  # fmt: skip
    found = {}
    for message in expected:
        wire.say("*RST;*CLS;" + message)
        found[message] = int(wire.ask("OUTPERRO?").split(",")[0])
    assert found == expected


def test_numbers_are_printed_with_fourteen_decimals_and_an_exponent_of_three_digits(wire) -> None:
    wire.say("STAR 10 MHZ;STOP 20 MHZ")
    assert (wire.ask("STAR?"), wire.ask("STOP?")) == ("+1.00000000000000E+007", "+2.00000000000000E+007")
    assert wire.ask("DEFECC1 -1E-12;DEFECC1?") == "-1.00000000000000E-012"
    assert wire.ask("OUTPSWPRMP? 1") == "+1.00000000000000E+007"
