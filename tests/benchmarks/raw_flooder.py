"""Sends bytes without end, with a key, over connections opened again when cut.

Called as python raw_flooder.py ENDPOINT WHAT SECONDS. Prints the megabytes sent, and how often it was disconnected.
"""

import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import raw_peer
from hostile_messages import ENDLESS
from keyed_peer import KeyedPeer

from pzctl.daemon.client.location import find
from pzctl.daemon.files.paths import home
from pzctl.daemon.wire.curve_keys import ClientKey
from pzctl.daemon.wire.frames import LARGEST_FRAME

CONNECTIONS = 4

LONGEST = LARGEST_FRAME - 64
"""The longest frame that is not rejected at once when encrypted."""


def flood(endpoint: str, what: str, key: ClientKey, until: float, told: list[int]) -> None:
    """Send until then; add the bytes and the disconnections to `told`."""
    kind, sent = ENDLESS[what]
    frames = [(more, content[:LONGEST]) for more, content in raw_peer.frames_in(sent * (65_536 // len(sent) or 1))]
    while time.monotonic() < until:
        try:
            peer = KeyedPeer(endpoint, kind, key)
            with peer.link as link:
                link.settimeout(max(0.1, until - time.monotonic()))
                while time.monotonic() < until:
                    block = peer.sealed(frames)
                    link.sendall(block)
                    told[0] += len(block)
        except OSError:
            told[1] += 1


def main() -> None:
    """Flood from several threads."""
    endpoint, what, seconds = sys.argv[1:]
    where = find(home())
    if where is None or where.key is None:
        sys.exit("there is no daemon, or no key for it")
    told, until = [0, 0], time.monotonic() + float(seconds)
    arguments = (endpoint, what, where.key, until, told)
    threads = [threading.Thread(target=flood, args=arguments) for _ in range(CONNECTIONS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print(told[0] // 1_000_000, told[1])


if __name__ == "__main__":
    main()
