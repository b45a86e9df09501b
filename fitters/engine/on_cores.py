"""Independent computations on several cores, in forked processes, which see all objects of this one."""

import os
import pickle
import signal
import struct
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import IO, Any, TypeVar

_Result = TypeVar("_Result")

_NUMBER = struct.Struct("=H")
"""Form of the number of a call on the pipe that hands them out; reading so few bytes is atomic."""


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def on_cores(calls: "Sequence[Callable[[], _Result]]", jobs: int) -> "list[_Result]":
    """Return the results of all calls in order, computed by `jobs` processes, of which this one is the first.

    Results are pickled; calls are not. They must neither wait for another thread nor have effects here. Whatever a
    process that died or failed leaves undone is computed here, so exceptions are raised as without processes. Where
    forking is impossible (Windows) or unsafe for linear algebra (macOS), everything is computed here.
    """
    if jobs < 2 or len(calls) < 2 or sys.platform != "linux":
        return [call() for call in calls]
    with ExitStack() as ended:
        numbers, told = os.pipe()
        queue = ended.enter_context(os.fdopen(numbers, "rb", buffering=0))
        with os.fdopen(told, "wb") as filled:
            filled.write(b"".join(map(_NUMBER.pack, range(len(calls)))))
        children = [_forked(calls, queue, ended) for _ in range(min(jobs, len(calls)) - 1)]
        made = _computed(calls, queue)
        for results in children:
            made |= _received(results)
    return [made[k] if k in made else call() for k, call in enumerate(calls)]


def _forked(calls: Sequence[Callable[[], Any]], queue: IO[bytes], ended: ExitStack) -> IO[bytes]:
    """Start a process that takes its share of the calls; return the pipe from which its results can be read."""
    read, write = os.pipe()
    parent = os.getpid()
    with warnings.catch_warnings():
        # Other threads of this process may hold locks; the child does nothing but compute, and needs none of them.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all; the parent handles it
            os.close(read)
            with os.fdopen(write, "wb") as pipe:
                pickle.dump(_computed(calls, queue, lambda: os.getppid() == parent), pipe)
        finally:
            os._exit(0)
    os.close(write)
    ended.callback(_end, child)
    return ended.enter_context(os.fdopen(read, "rb"))


def _end(child: int) -> None:
    """End a child, at once if it has not ended by itself, and forget it."""
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def _computed(
    calls: Sequence[Callable[[], Any]], queue: IO[bytes], awaited: Callable[[], bool] = lambda: True
) -> dict[int, Any]:
    """Compute one call after another until none is left or nobody awaits the results; leave out those that fail."""
    made: dict[int, Any] = {}
    while awaited() and (number := queue.read(_NUMBER.size)):
        (k,) = _NUMBER.unpack(number)
        try:
            made[k] = calls[k]()
        except Exception:  # noqa: S112 - raised again by the parent, where it is computed once more
            continue
    return made


def _received(results: IO[bytes]) -> dict[int, Any]:
    try:
        return pickle.load(results)  # noqa: S301 - from a process of our own
    except (EOFError, pickle.UnpicklingError):  # it died
        return {}
