"""Many fits at once: on all cores of this machine, or on a Dask cluster, with the same results."""

import contextlib
import re
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from ...models.base.errors import PzctlError
from ..engine.on_cores import available_cores
from ..interface import FitResult, FitTask
from ..plugins import load_fitter, run
from .process_pool import started

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_PATIENCE = 10.0
"""Seconds to wait for an answer of the Dask scheduler."""
_ADDRESS = re.compile(r"((tcp|tls)://)?[^/\s]+:\d{1,5}")

_one_at_a_time = threading.Lock()
"""Lock per process: a Dask worker may have several threads, for which a third party's fitter may not be made."""


class BatchError(PzctlError):
    """A batch that cannot be run at all."""


@dataclass(frozen=True, eq=False)
class BatchJob:
    """One sample to be fitted."""

    sample: str
    task: FitTask


@dataclass(frozen=True, eq=False)
class BatchOutcome:
    """Result of a job, or the sentence that says why there is none."""

    sample: str
    result: FitResult | None
    error: str | None = None


Heard = Callable[[BatchOutcome], None]
"""Called with each outcome as it arrives, in any order."""


def fit_job(job: BatchJob, fitter: str) -> BatchOutcome:
    """Fit one sample in this process. Raises nothing: any failure becomes the outcome's sentence."""
    try:
        with _one_at_a_time:
            return BatchOutcome(job.sample, run(load_fitter(fitter), job.task))
    except PzctlError as error:
        return BatchOutcome(job.sample, None, str(error))
    except Exception as error:  # whatever a third party's fitter does
        return BatchOutcome(job.sample, None, f"fitter {fitter!r} failed: {type(error).__name__}: {error}")


def fit_on_cores(
    jobs: Sequence[BatchJob], fitter: str, heard: Heard = lambda _: None, processes: int | None = None
) -> tuple[BatchOutcome, ...]:
    """Fit all jobs in so many processes at a time, None for one on each core; return the outcomes in their order.

    Raises PluginError if the fitter is not installed. Ctrl-C ends the running fits at once.
    """
    load_fitter(fitter)
    if not jobs:
        return ()
    with started(partial(fit_job, fitter=fitter), jobs, min(len(jobs), processes or available_cores())) as futures:
        return _gathered(futures, as_completed(futures), heard)


def fit_on_dask(
    jobs: Sequence[BatchJob], fitter: str, address: str, heard: Heard = lambda _: None
) -> tuple[BatchOutcome, ...]:
    """Fit all jobs on the Dask cluster whose scheduler is at `address` (host:port); order as in `fit_on_cores`.

    The results equal those of `fit_on_cores` to the last bit (except `seconds`) if the workers have the same processor
    and the same versions. Raises BatchError if Dask is not installed, `address` is invalid or no scheduler answers
    there, PluginError if the fitter is not installed here.
    """
    load_fitter(fitter)
    with on_dask(address) as client:
        futures = {client.submit(fit_job, job, fitter, pure=False): job for job in jobs}
        return _gathered(futures, _finished_on_dask(client, futures), heard)


@contextlib.contextmanager
def on_dask(address: str) -> Generator[Any]:
    """Connect to the Dask scheduler at `address` (host:port, or with tcp:// or tls:// before it) and yield the client.

    Raises BatchError if Dask is not installed, `address` is invalid or no scheduler answers there.
    """
    if not _ADDRESS.fullmatch(address):
        raise BatchError(f"Dask scheduler {address!r}: HOST:PORT is needed")
    try:
        distributed: Any = import_module("distributed")  # an extra: nothing else of pzctl needs it
    except ImportError:
        raise BatchError("--dask needs Dask, which is not installed: pip install 'dask[distributed]'") from None
    try:
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:  # no such host; nobody there; no such port
        raise BatchError(f"no Dask scheduler answers at {address!r}: {error}") from None
    with client:
        yield client


def _finished_on_dask(client: Any, futures: dict[Any, Any]) -> Iterable[Any]:
    return import_module("distributed").as_completed(futures, loop=client.loop)


@dataclass(frozen=True)
class Failure:
    """The sentence that says why there is no result."""

    says: str


def attempted(call: "Callable[[_Item], _Result]", item: "_Item") -> "_Result | Failure":
    """Return what `call` makes of an item in this process, or why it makes nothing of it. Raises nothing."""
    try:
        with _one_at_a_time:
            return call(item)
    except PzctlError as error:
        return Failure(str(error))
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        return Failure(f"the numbers do not allow it: {error}")


def results_of(
    call: "Callable[[_Item], _Result]",
    items: "Sequence[_Item]",
    workers: Any,
    heard: "Callable[[int, _Result | Failure], None]" = lambda _k, _r: None,
) -> "list[_Result | Failure]":
    """Run `call` with every item; return results in their order.

    `workers`: from `process_pool`, or the client of a Dask cluster from `on_dask`. `heard` is called with each result
    as it arrives.
    """
    made: dict[int, _Result | Failure] = {}

    def gather(futures: dict[Any, int], done: Iterable[Any]) -> None:
        for future in done:
            k = futures[future]
            try:
                made[k] = future.result()
            except BrokenProcessPool:
                made[k] = Failure("a process of the batch died (killed, or out of memory)")
            except Exception as error:
                made[k] = Failure(f"the worker could not do it: {type(error).__name__}: {error}")
            heard(k, made[k])

    if isinstance(workers, ProcessPoolExecutor):
        here = {workers.submit(attempted, call, item): k for k, item in enumerate(items)}
        gather(here, as_completed(here))
    else:
        futures = {workers.submit(attempted, call, item, pure=False): k for k, item in enumerate(items)}
        gather(futures, _finished_on_dask(workers, futures))
    return [made[k] for k in range(len(items))]


def _gathered(futures: dict[Any, BatchJob], done: Iterable[Any], heard: Heard) -> tuple[BatchOutcome, ...]:
    """Return the outcomes in the order of the jobs; `done` yields the futures as they end."""
    outcomes: dict[Any, BatchOutcome] = {}
    for future in done:
        outcomes[future] = _outcome(future, futures[future])
        heard(outcomes[future])
    return tuple(outcomes[future] for future in futures)


def _outcome(future: "Future[BatchOutcome]", job: BatchJob) -> BatchOutcome:
    """Return a job's outcome, even if its process died or a worker could not begin."""
    try:
        return future.result()
    except BrokenProcessPool:
        return BatchOutcome(job.sample, None, "a process of the batch died (killed, or out of memory)")
    except Exception as error:
        return BatchOutcome(job.sample, None, f"the worker could not do it: {type(error).__name__}: {error}")
