"""What a guest of the daemon may use: memory, seconds for one answer, and room in its log."""

import sys
from dataclasses import dataclass

MB = 1 << 20
"""Bytes."""

LARGEST_LOG = 64 * MB
"""Bytes that a guest's log may grow to; what it writes beyond fails with an OSError in the guest."""


@dataclass(frozen=True)
class Limits:
    """What one fit may use. A guest that needs more is ended, and the daemon goes on."""

    seconds: float = 300.0
    """From the moment a measurement is the guest's turn until its answer."""
    memory_MB: int = 4096
    """Address space of the process, which is always more than it uses."""
    start_seconds: float = 60.0
    """From the start of the process until it says hello."""


def allow_many_files() -> None:
    """Let this process open as many files as it may: every connection is one."""
    if sys.platform != "win32":
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def limit_memory(memory_MB: int) -> None:
    """Limit this process for good: address space, size of any file it writes, no core dumps.

    Beyond the first, Python raises MemoryError. Does nothing where the platform has no such limits (Windows).
    """
    if sys.platform == "win32":
        return
    import resource

    for what, most in (
        (resource.RLIMIT_AS, memory_MB * MB),
        (resource.RLIMIT_FSIZE, LARGEST_LOG),
        (resource.RLIMIT_CORE, 0),
    ):
        _, hard = resource.getrlimit(what)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (allowed, allowed))
