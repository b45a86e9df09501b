"""One program at a time commands an instrument, whoever runs it on this machine.

The lock is a socket with a name made from the address or the serial number, in Linux's abstract namespace: it is common
to all accounts, needs no folder that all of them can write, and ends with its process, however that ends. Other systems
have nothing like it; there, only the data folder is locked.
"""

import hashlib
import socket
import struct
import sys

from ..base.analyzer import InstrumentError

_CREDENTIALS = struct.Struct("3i")
"""Process, user and group at the other end of a local socket."""


def lock_instrument(what: str, name: str) -> socket.socket | None:
    """Return a lock of an instrument, which its end or `close` releases; None if there are no locks.

    `what` is its address or the result of `unit_of`, `name` its name for people. Raises InstrumentError if another
    program has the lock.
    """
    if sys.platform != "linux":
        return None
    lock_name = f"\0pzctl {hashlib.sha256(what.encode()).hexdigest()}"
    lock = socket.socket(socket.AF_UNIX)
    try:
        lock.bind(lock_name)
    except OSError:
        lock.close()
        raise InstrumentError(
            f"{name}: {_holder(lock_name)} uses this analyzer already; end that one first, or use it"
        ) from None
    lock.listen(64)  # so that others can ask who has it
    return lock


def unit_of(idn: str) -> str | None:
    """Return model and serial number in an answer to `*IDN?`, or None if it has no serial number."""
    fields = [field.strip().upper() for field in idn.strip().strip('"').split(",")]
    if len(fields) < 3 or not fields[2].strip("0"):  # some models say 0
        return None
    return f"{fields[1]} {fields[2]}"


def _holder(lock_name: str) -> str:
    """Return which program has a lock, as the subject of a sentence."""
    import pwd

    with socket.socket(socket.AF_UNIX) as other:
        other.setblocking(False)
        try:
            other.connect(lock_name)
            size = _CREDENTIALS.size
            pid, user, _ = _CREDENTIALS.unpack(other.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size))
            return f"process {pid} of {pwd.getpwuid(user).pw_name}"
        except (OSError, KeyError):  # it has just ended, does not answer, or has an account of another container
            return "another program"
