"""A separate process for the page's computations, so that events and buttons never wait for them."""

import os
from collections.abc import Callable
from concurrent.futures import CancelledError, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from threading import Lock
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

PATIENCE = 120.0
"""Seconds to wait for an answer."""
_NICE = 5
"""Increment of the niceness: lower priority than the daemon, higher than a diagnosis in the background."""


class NoAnswer(Exception):
    """The process ended, or gave no answer within `PATIENCE`."""


class WorkerProcess:
    """One process, started when first needed. Thread-safe."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._lock = Lock()

    def ask(self, work: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Return what a function of a module returns there. Raises NoAnswer, and what the function raises."""
        with self._lock:
            pool = self._pool = self._pool or _new_pool()
        try:
            return pool.submit(work, *arguments, **options).result(PATIENCE)
        except (BrokenProcessPool, TimeoutError, CancelledError):  # cancelled: another question took too long
            with self._lock:
                self._pool = None if self._pool is pool else self._pool
            _end(pool)
            raise NoAnswer from None

    def close(self) -> None:
        """End the process."""
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is not None:
            _end(pool)


def _new_pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, get_context("spawn"), initializer=_lower_priority)


def _end(pool: ProcessPoolExecutor) -> None:
    """End a pool at once and discard its work."""
    processes: dict[int, Any] = getattr(pool, "_processes", None) or {}
    workers = [*processes.values()]
    pool.shutdown(wait=False, cancel_futures=True)
    for worker in workers:
        worker.terminate()


def _lower_priority() -> None:
    if hasattr(os, "nice"):
        os.nice(_NICE)
