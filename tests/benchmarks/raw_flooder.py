"""Sends bytes without end over connections that are opened again when cut: python raw_flooder.py ENDPOINT WHAT SECONDS.

Prints the megabytes it got rid of, and how often it was cut off.
"""

import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import raw_peer
from test_hostile_messages import ENDLESS

CONNECTIONS = 4


def flood(endpoint: str, what: str, until: float, told: list[int]) -> None:
    """Send until then; add the bytes and the cuts to `told`."""
    kind, sent = ENDLESS[what]
    block = sent * (65_536 // len(sent) or 1)
    while time.monotonic() < until:
        try:
            with raw_peer.greeted(endpoint, kind) as link:
                link.settimeout(max(0.1, until - time.monotonic()))
                while time.monotonic() < until:
                    link.sendall(block)
                    told[0] += len(block)
        except (OSError, AssertionError):
            told[1] += 1


def main() -> None:
    """Flood from several threads."""
    endpoint, what, seconds = sys.argv[1:]
    told, until = [0, 0], time.monotonic() + float(seconds)
    threads = [threading.Thread(target=flood, args=(endpoint, what, until, told)) for _ in range(CONNECTIONS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print(told[0] // 1_000_000, told[1])


if __name__ == "__main__":
    main()
