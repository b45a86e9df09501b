"""Limits of a fitter worker: memory, seconds per answer, and size of its log."""

import sys
from dataclasses import dataclass

MB = 1 << 20
"""Bytes."""

LARGEST_LOG = 64 * MB
"""Bytes that a worker's log may grow to; writing more raises OSError in the worker."""


@dataclass(frozen=True)
class Limits:
    """Limits of one fit. The daemon ends a worker that exceeds them, and goes on."""

    seconds: float = 300.0
    """From handing a measurement to the worker until its answer."""
    memory_MB: int = 4096
    """Address space of the process, which is always more than the memory it uses."""
    start_seconds: float = 60.0
    """From the start of the process until it says hello."""


def allow_many_files() -> int:
    """Raise this process's limit of open files to the hard limit, since every connection takes one; return it."""
    if sys.platform == "win32":
        return sys.maxsize
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return sys.maxsize if hard == resource.RLIM_INFINITY else hard


def limit_memory(memory_MB: int) -> None:
    """Limit this process permanently: address space (MB), size of any file it writes, no core dumps.

    Python raises MemoryError when the address space is used up. Does nothing on Windows, which has no such limits.
    """
    limit_files()
    if sys.platform != "win32":
        import resource

        _limit(resource.RLIMIT_AS, memory_MB * MB)


def limit_files() -> None:
    """Limit this process permanently: size of any file it writes, such as its log, and no core dumps."""
    if sys.platform != "win32":
        import resource

        _limit(resource.RLIMIT_FSIZE, LARGEST_LOG)
        _limit(resource.RLIMIT_CORE, 0)


def _limit(kind: int, limit: int) -> None:
    if sys.platform != "win32":
        import resource

        _, hard = resource.getrlimit(kind)
        allowed = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        resource.setrlimit(kind, (allowed, allowed))
