"""A blocking helper that sends one command to the virtual bench."""

import json
import socket
from typing import Any

from .bench_errors import BenchError


def bench_command(host: str, port: int, *, timeout: float = 10.0, **command: Any) -> dict[str, Any]:
    """Send a command to the port of the bench and return its answer.

    `bench_command("127.0.0.1", 5026, command="step", name="ml1")` glues the first matching layer.
    Raises BenchError if nobody answers within `timeout` seconds or the bench refuses the command.
    """
    where = f"bench at {host}:{port}"
    try:
        with socket.create_connection((host, port), timeout=timeout) as link, link.makefile("rwb") as lines:
            lines.write(json.dumps(command).encode("utf-8") + b"\n")
            lines.flush()
            line = lines.readline()
    except OSError as error:
        raise BenchError(f"{where}: nobody answers ({error.strerror or error}); is `pzctl sim` running?") from error
    if not line:
        raise BenchError(f"{where}: the connection was closed without an answer")
    try:
        answer: dict[str, Any] = json.loads(line)
    except ValueError as error:
        raise BenchError(f"{where}: the answer {line[:40]!r} is no JSON; another program listens there") from error
    if not answer.get("ok"):
        raise BenchError(str(answer.get("error", f"{where}: refused without a reason")))
    return answer
