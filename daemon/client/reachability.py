"""Whether a daemon that says nothing is only busy, or has ended: its machine refuses connections then."""

import socket
from urllib.parse import urlsplit

PATIENCE = 3.0
"""Seconds to wait for a machine's refusal: Windows asks several times before it believes one."""


def is_refused(endpoint: str) -> bool:
    """Return whether nobody listens at an endpoint, as its machine says.

    The system accepts connections for a daemon that is busy. A machine that does not answer says nothing.
    """
    where = urlsplit(endpoint)
    try:
        socket.create_connection((where.hostname, where.port), PATIENCE).close()
    except ConnectionRefusedError:
        return True
    except (OSError, ValueError):
        return False
    return False
