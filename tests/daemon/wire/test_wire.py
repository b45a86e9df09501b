"""The wire: messages are read as they were written, and arbitrary bytes raise one sentence at most."""

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from schemas import schemas, text

from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, SweepEvent, decode, encode, sweep_columns, topic
from pzctl.daemon.wire.frames import ColumnHeader, WireError, unpack
from pzctl.models.build import Build, LoadSpec, Quantity, Step
from pzctl.models.sweep import Sweep

ROOT = Path(__file__).resolve().parents[3]
AIR = LoadSpec("air", Quantity(413.0))
BUILD = Build("S4", Quantity(2e-4), (), AIR, AIR, (Step("disk", ()),))


def message(sweep: Sweep, **settings: object) -> list[bytes]:
    columns, payload = sweep_columns(sweep)
    event = SweepEvent(
        run="r",
        seq=7,
        id="s",
        time="2026-11-21T02:14:03.120Z",
        measurement="m",
        sample=SampleStep("S4", "disk"),
        instrument=InstrumentInfo(
            "GPIB0::17::INSTR", "HEWLETT-PACKARD,4294A", "4294A", "JP1", "REV1.11", simulated=False
        ),
        build=BUILD,
        segment=1,
        segments=1,
        started="2026-11-21T02:14:01.000Z",
        settings=dict(settings),
        notes=("polarity inverted",),
        columns=columns,
    )
    return encode(event, payload)


VALID = message(Sweep(np.linspace(1e6, 2e6, 5), np.arange(5) + 1j, id="s"), oscillator_V=0.5)


@given(arrays(np.complex128, st.integers(2, 60), elements=st.complex_numbers(allow_nan=False, allow_infinity=False)))
def test_a_sweep_arrives_bit_for_bit(impedance: np.ndarray) -> None:
    frequency = np.linspace(40.0, 110e6, impedance.size)
    heard = decode(message(Sweep(frequency, impedance, id="s"), bandwidth=np.int64(5))).sweep()
    assert np.array_equal(heard.frequency, frequency)
    assert np.array_equal(heard.impedance, impedance)
    assert heard.settings == {"bandwidth": 5}
    assert heard.notes == ("polarity inverted",)


def test_any_language_can_read_a_message() -> None:
    first, header, *raw = message(Sweep(np.array([1e6, 2e6]), np.array([1 + 2j, 3 - 4j])), sweep_seconds=float("nan"))
    said = json.loads(header)
    assert first == b"sweep.S4.disk."
    assert said["columns"][1] == {"name": "impedance", "unit": "ohm", "dtype": "<c16", "shape": [2]}
    assert np.frombuffer(raw[1], "<f8").tolist() == [1.0, 2.0, 3.0, -4.0]
    assert said["settings"]["sweep_seconds"] is None, "a missing number is null, never NaN"


@given(st.lists(st.binary(max_size=200), max_size=6))
def test_random_frames_are_refused(frames: list[bytes]) -> None:
    with pytest.raises(WireError):
        decode(frames)


@given(st.integers(0, 3), st.integers(0, 4000), st.binary(max_size=4), st.integers(0, 60))
def test_a_damaged_message_is_read_or_refused(frame: int, at: int, put: bytes, gone: int) -> None:
    frames = list(VALID)
    at = min(at, len(frames[frame]))
    frames[frame] = frames[frame][:at] + put + frames[frame][at + gone :]
    with contextlib.suppress(WireError):  # any other exception fails the test
        decode(frames).sweep()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b'"shape":[5]', b'"shape":[1000000000000,1000000]', "has 40 bytes; its shape .* needs 8000000000000000000"),
        (b'"shape":[5]', b'"shape":[-5]', "Expected `int` >= 0"),
        (b'"dtype":"<c16"', b'"dtype":"|O"', "Invalid enum value"),
        (b'"name":"impedance"', b'"name":"frequency"', "two columns are called 'frequency'"),
        (b'"name":"impedance"', b'"name":"Z"', "sweep 's' has no column 'impedance'"),
        (b'"v":1', b'"v":2', "it has wire version 2; this program reads version 1; upgrade"),
        (b'"kind":"sweep"', b'"kind":"song"', "kind 'song'; known are beat, diagnosis"),
        (b'"settings":{', b'"settings":{"a":' + b"[" * 100_000, "nested too deep"),
        (b'"settings":{', b'"settings":{"a":"' + b"x" * 9_000_000 + b'",', "at most 8388608 are allowed"),
    ],
)
def test_what_is_wrong_is_named(old: bytes, new: bytes, says: str) -> None:
    assert old in VALID[1]
    with pytest.raises(WireError, match=says):
        decode([VALID[0], VALID[1].replace(old, new), *VALID[2:]]).sweep()


def test_an_empty_column_has_a_shape_that_an_array_can_have() -> None:
    for shape in ((0,) * 100, (10**30, 0), (2**62, 0)):
        with pytest.raises(WireError, match="column 'a' cannot have its shape"):
            unpack([ColumnHeader("a", "", "<f8", shape)], [b""])


def test_a_frame_too_few_and_one_too_many() -> None:
    for frames in (VALID[:-1], [*VALID, b""], VALID[:1], VALID * 100):
        with pytest.raises(WireError, match="frame"):
            decode(frames)


def test_nothing_is_written_that_no_reader_accepts() -> None:
    """A long sweep has numbers for each of its points in the settings; those of 200,000 take some 4 MB."""
    sweep = Sweep(np.array([1e6, 2e6]), np.array([1 + 2j, 3 - 4j]))
    long = message(sweep, noise_relative=[1.23e-5] * 400_000)
    assert len(long[1]) > 3_000_000
    assert len(decode(long).sweep().settings["noise_relative"]) == 400_000
    with pytest.raises(WireError, match=r"event: a header of 900\d+ bytes; at most 8388352 are allowed"):
        message(sweep, noise_relative="x" * 9_000_000)
    with pytest.raises(WireError, match="event: a column of 9600000 bytes"):
        message(Sweep(np.linspace(1e6, 2e6, 600_000), np.ones(600_000) + 1j))


def test_unknown_fields_are_ignored() -> None:
    assert decode([VALID[0], VALID[1].replace(b'"v":1', b'"v":1,"mood":"good"'), *VALID[2:]]).event.seq == 7


@given(st.text(max_size=8), st.text(max_size=8), st.text(max_size=8), st.text(max_size=8))
def test_no_topic_is_a_prefix_of_another(a: str, b: str, c: str, d: str) -> None:
    one, other = topic("sweep", a, b), topic("sweep", c, d)
    assert one.startswith(other) == ((a, b) == (c, d))
    assert one.isascii()
    assert one.count(b".") == 3


def test_the_schemas_in_the_docs_are_those_of_the_code() -> None:
    written = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "schema").glob("*.json")}
    assert written == {name: text(schema) for name, schema in schemas().items()}, "write them anew: make docs"
