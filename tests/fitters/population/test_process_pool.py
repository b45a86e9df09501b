"""The process pool leaves no process and no thread behind after Ctrl-C or an error."""

import multiprocessing
import threading
import time

import pytest

from pzctl.fitters.population.process_pool import started

pytestmark = pytest.mark.usefixtures("as_for_users")


@pytest.mark.parametrize("end", [KeyboardInterrupt, ValueError])
def test_an_interrupted_pool_leaves_no_process_and_no_thread(end: type[BaseException]) -> None:
    """A thread that outlives the pool writes "Bad file descriptor" when the interpreter ends."""
    processes, threads = set(multiprocessing.active_children()), set(threading.enumerate())
    begun = time.monotonic()
    with pytest.raises(end), started(time.sleep, [600.0] * 4, workers=2):
        raise end
    assert time.monotonic() - begun < 60
    assert set(multiprocessing.active_children()) <= processes
    assert set(threading.enumerate()) <= threads


def test_a_pool_that_ends_normally_gives_every_answer() -> None:
    with started(abs, [-1, -2, -3], workers=2) as futures:
        assert {item: future.result() for future, item in futures.items()} == {-1: 1, -2: 2, -3: 3}
