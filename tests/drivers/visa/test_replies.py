"""Answers are parsed strictly: valid ones are read exactly, all others give one sentence."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.drivers.agilent4294a.protocol.error_queue import queued_error
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.drivers.visa import replies

PARSERS = {
    "number": lambda text: replies.number(text, "X?"),
    "integer": lambda text: replies.integer(text, "X?"),
    "flag": lambda text: replies.flag(text, "X?"),
    "word": lambda text: replies.word(text, "X?", ("LIN", "LOG")),
    "error": lambda text: queued_error(text, "X?"),
    "header": lambda text: replies.block_length(text.encode("latin-1", "replace"), 6, "X?"),
}


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_in_all_notations_of_instruments(x):
    for text in (f"{x:+.11E}", f"{x:.6e}", f" {x:.12E}"):
        assert replies.number(text, "STAR?") == float(text)


@pytest.mark.parametrize(
    "text", ["", " ", "1,5", "0x10", "1_000", "nan", "inf", "1e999", "1 2", "١", "1\n", "--1", "1e"]
)
def test_what_python_takes_for_a_number_and_an_instrument_never_sends(text):
    with pytest.raises(InstrumentError, match=r"STAR\?: the answer is .* a finite number is expected"):
        replies.number(text, "STAR?")


@pytest.mark.parametrize(
    ("text", "error"),
    [('0,"NO ERROR"', (0, "NO ERROR")), ("+0,NO ERROR", (0, "NO ERROR")), ('-113,"UNDEFINED"', (-113, "UNDEFINED"))],
)
def test_errors_with_and_without_quotes(text, error):
    found = queued_error(text, "OUTPERRO?")
    assert (found.number, found.text) == error


@given(st.sampled_from(sorted(PARSERS)), st.text() | st.from_regex(r"[-+#0-9.,E\"ONF]{0,12}"))
def test_nothing_but_a_value_or_a_sentence(parser, text):
    try:
        PARSERS[parser](text)
    except InstrumentError as error:
        sentence = str(error)
        assert "\n" not in sentence
        assert len(sentence) < 500


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=50), st.data())
def test_blocks_are_read_exactly_and_damaged_ones_refused(values, data):
    raw = np.array(values, ">f8").tobytes()
    np.testing.assert_array_equal(replies.doubles(raw, len(values), "OUTPDATA?"), values)
    length = data.draw(st.integers(0, len(raw) + 20).filter(lambda n: n != len(raw)))
    with pytest.raises(InstrumentError, match=f"{length} bytes came"):
        replies.doubles((raw + b"\0" * 20)[:length], len(values), "OUTPDATA?")
    with contextlib.suppress(InstrumentError):  # any bytes of the right length: finite numbers, or a sentence
        noise = data.draw(st.binary(min_size=len(raw), max_size=len(raw)))
        assert np.isfinite(replies.doubles(noise, len(values), "OUTPDATA?")).all()
