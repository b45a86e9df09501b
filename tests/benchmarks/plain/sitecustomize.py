"""On the PYTHONPATH of a daemon that is measured: leaves out what PZCTL_PLAIN names, `curve` or `chain` or both.

Nothing in the daemon can do this; what encryption and the hash chain cost is measured against it.
"""

import os
from typing import Any

import zmq
from msgspec.structs import replace


def without_curve() -> None:
    """Let sockets of this process speak without keys, and everybody in."""
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
