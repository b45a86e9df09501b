"""Work on all cores of this machine that ends at once on Ctrl-C."""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ProcessPoolExecutor
from typing import TypeVar

_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")


@contextlib.contextmanager
def started(
    call: Callable[[_Item], _Answer], items: Iterable[_Item], workers: int
) -> "Generator[dict[Future[_Answer], _Item]]":
    """Start `call` with every item, so many at a time in processes of their own; yield what is to come, with its item.

    Whatever ends the block before its end, Ctrl-C before all, ends what still runs and drops what waits.
    """
    before = multiprocessing.active_children()
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_leave_ctrl_c_to_the_parent)
    try:
        with _one_thread_each(), ctrl_c_blocked():
            futures = {pool.submit(call, item): item for item in items}
        yield futures
    except BaseException:
        for child in set(multiprocessing.active_children()) - set(before):
            child.terminate()
        # Wait in the first call: shutdown(wait=False) forgets the pool's thread, and a second call cannot wait for it.
        # That thread would close its pipes while the ending interpreter writes to them: "Bad file descriptor".
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown(wait=True)


def _leave_ctrl_c_to_the_parent() -> None:
    """Ctrl-C goes to all processes of a terminal; only one of them is to answer it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def _one_thread_each() -> Generator[None]:
    """Let the processes that start here use one thread each for linear algebra: the cores are taken by other fits."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def ctrl_c_blocked() -> Generator[None]:
    """Let the processes that start here inherit a blocked Ctrl-C, so that none dies of it before it ignores it.

    A Ctrl-C of these milliseconds is answered at their end. Windows has no such thing and does without.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
