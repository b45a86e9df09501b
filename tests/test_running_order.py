"""Tests begin with the longest in every process of a parallel run."""

from pathlib import Path

import pytest
from running_order import LONGEST, in_shares

TESTS = Path(__file__).parent


def test_the_longest_modules_exist() -> None:
    assert [name for name in LONGEST if not (TESTS / f"{name}.py").exists()] == []


@pytest.mark.parametrize("shares", [1, 3, 4])
def test_every_share_begins_with_its_longest_modules_and_no_test_is_lost(shares: int) -> None:
    tests = [(name, k) for name in ("a", LONGEST[2], "b", LONGEST[0], LONGEST[1], "c", LONGEST[3]) for k in range(100)]
    ordered = in_shares(tests, shares, lambda test: test[0])
    assert sorted(ordered) == sorted(tests)
    size = len(tests) // shares
    firsts = [ordered[share * size][0] for share in range(shares)]
    assert firsts == list(LONGEST[:shares])
