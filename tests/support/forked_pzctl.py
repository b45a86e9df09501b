"""The command `pzctl` in a shell that a test starts: a forked child of the test's fork server (see fork_server.py).

It imports little, because it begins as a new interpreter. The child is in the same process group, so Ctrl-C reaches it;
SIGTERM is handed on to it. This process ends with the child's status.
"""

import _socket
import json
import os
import signal
import struct
import sys


def main() -> None:
    given = int(os.environ.pop("PZCTL_FORK_SERVER"))
    words = [os.path.join(os.path.dirname(sys.executable), "pzctl"), *sys.argv[1:]]  # noqa: PTH118, PTH120
    request = {"words": words, "environment": dict(os.environ), "folder": os.getcwd()}  # noqa: PTH109
    request |= {"session": False, "group": os.getpgrp(), "ignored": [], "waits": True}
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ours, theirs = os.pipe()
    files = [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, struct.pack("4i", 0, 1, 2, theirs))]
    _socket.socket(fileno=given).sendmsg([json.dumps(request).encode()], files)
    os.close(theirs)
    with open(ours) as answer:  # noqa: PTH123
        child = int(answer.readline())
        signal.signal(signal.SIGTERM, lambda kind, _: os.kill(child, kind))
        status = os.waitstatus_to_exitcode(int(answer.readline()))
    sys.exit(status if status >= 0 else 128 - status)


if __name__ == "__main__":
    main()
