"""Numbers as text: significant digits without an exponent."""

import pytest

from pzctl.models.base.plain_numbers import without_exponent


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (123.4, 2, "120"),
        (1283.2, 3, "1280"),
        (12.0, 2, "12"),
        (0.00421, 2, "0.0042"),
        (99.96, 2, "100"),
        (0.0, 3, "0"),
        (3.2e-7, 2, "3.2e-07"),
        (float("inf"), 2, "inf"),
    ],
)
def test_a_number_has_its_significant_digits_and_no_exponent(value: float, digits: int, text: str) -> None:
    assert without_exponent(value, digits) == text
