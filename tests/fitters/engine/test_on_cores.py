"""Computations on several cores: results in order, failures as without processes, and no process left behind."""

import os
import sys
from functools import partial
from pathlib import Path

import pytest

from pzctl.fitters.engine.on_cores import on_cores


def children() -> str:
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text()


@pytest.mark.parametrize("jobs", [1, 3])
def test_results_are_in_the_order_of_the_calls(jobs: int) -> None:
    unpicklable = {k: lambda k=k: k for k in range(40)}
    assert on_cores([lambda k=k: unpicklable[k]() ** 2 for k in range(40)], jobs) == [k**2 for k in range(40)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_exception_is_raised_as_it_was(jobs: int) -> None:
    with pytest.raises(ZeroDivisionError):
        on_cores([partial(divmod, 7, k) for k in (2, 1, 0, 3)], jobs)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere everything is computed in this process")
def test_what_a_killed_process_leaves_is_computed_here() -> None:
    here = os.getpid()

    def where() -> int:
        if os.getpid() != here:
            os._exit(1)
        return os.getpid()

    before = children()
    assert on_cores([where] * 6, 3) == [here] * 6
    assert children() == before, "a process is left behind"
