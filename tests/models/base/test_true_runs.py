import numpy as np
import pytest

from pzctl.models.base.true_runs import true_runs


@pytest.mark.parametrize(
    ("mask", "runs"),
    [("", []), ("...", []), ("###", [(0, 3)]), ("#..##.#", [(0, 1), (3, 5), (6, 7)]), (".##.", [(1, 3)])],
)
def test_runs_begin_and_end_with_the_mask(mask: str, runs: list[tuple[int, int]]) -> None:
    assert true_runs(np.array([letter == "#" for letter in mask], np.bool_)) == runs
