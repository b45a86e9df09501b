"""On the PYTHONPATH of a benchmarked daemon: switches off what PZCTL_PLAIN names, `curve` or `chain` or both.

The daemon itself has no such option; the benchmark measures the cost of encryption and of the hash chain with it.
"""

import os
from typing import Any

import zmq
from msgspec.structs import replace


def without_curve() -> None:
    """Let sockets of this process work without keys, and accept everybody."""
    from pzctl.daemon.client import location
    from pzctl.daemon.server.access.access_control import AccessControl

    keep, announce = zmq.Socket.set, location.announce

    def plain(link: Any, option: int, value: Any) -> None:
        if zmq.SocketOption(option).name not in UNSET:
            keep(link, option, value)

    zmq.Socket.set = plain
    location.announce = lambda folder, where: announce(folder, replace(where, key=None))
    AccessControl.check = lambda *_: "local"
    AccessControl.allows = lambda *_: True


def without_chain() -> None:
    """Write the rows of a journal without entries in the chain."""
    from pzctl.daemon.journal.stores import chain

    chain._append = lambda *_: None


UNSET = ("CURVE_SERVER", "CURVE_SERVERKEY", "CURVE_PUBLICKEY", "CURVE_SECRETKEY", "ZAP_DOMAIN", "ZAP_ENFORCE_DOMAIN")

if "curve" in os.environ.get("PZCTL_PLAIN", ""):
    without_curve()
if "chain" in os.environ.get("PZCTL_PLAIN", ""):
    without_chain()
