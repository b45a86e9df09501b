"""Parallel work on all cores of this machine that ends at once on Ctrl-C."""

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
def process_pool(workers: int) -> Generator[ProcessPoolExecutor]:
    """Start so many processes, each with one thread for linear algebra, and yield their pool.

    If the block ends early, above all by Ctrl-C, running calls are ended and waiting ones dropped.
    """
    before = multiprocessing.active_children()
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_leave_ctrl_c_to_the_parent)
    try:
        with _one_thread_each(), ctrl_c_blocked():
            pool.submit(_nothing)  # the first call starts all processes
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - set(before):
            child.terminate()
        # Wait in the first call: shutdown(wait=False) forgets the pool's thread, and a second call cannot wait for it.
        # That thread would close its pipes while the exiting interpreter writes to them: "Bad file descriptor".
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown(wait=True)


@contextlib.contextmanager
def started(
    call: Callable[[_Item], _Answer], items: Iterable[_Item], workers: int
) -> "Generator[dict[Future[_Answer], _Item]]":
    """Run `call` with every item in a pool of so many processes; yield the futures with their items."""
    with process_pool(workers) as pool:
        yield {pool.submit(call, item): item for item in items}


def _nothing() -> None:
    """Do nothing, in another process."""


def _leave_ctrl_c_to_the_parent() -> None:
    """Ignore Ctrl-C, which goes to all processes of a terminal; only the parent handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def _one_thread_each() -> Generator[None]:
    """Let the processes that start here use one thread each for linear algebra: other fits use the other cores."""
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

    A Ctrl-C during these milliseconds is handled at their end. Windows has no such mask and does without.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
