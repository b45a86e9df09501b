"""The process that serves the page, until Ctrl-C or for as long as the daemon that started it runs.

python -m pzctl.daemon.page.page_process BUILD.toml PORT
"""

import os
import socket
import ssl
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

from ...models.base.errors import PzctlError
from ...models.build import Build
from ..files.builds.build_check import needed_plan
from ..files.builds.build_file import read_build
from ..files.worker_limits import allow_many_files
from ..server.logs import begin_log
from ..server.workers.subprocesses import end_child, end_with_parent, start_child
from .page_users import PageUsers

PORT = 8294
MOST_CONNECTIONS = 200
"""Greatest number of connections, of which a page holds two or three; for a further one an idle one is closed."""
BACKLOG = 32
"""Number of connections that are accepted at once, before it is known whether there are too many."""
OTHER_FILES = 160
"""Number of files kept for everything but connections: threads that ask the daemon, and what is being accepted."""
_LOOPBACK = "127.0.0.1"


class PageError(PzctlError):
    """The page cannot be served."""


def check_installed() -> None:
    """Raise PageError if a package that the page needs is not installed."""
    try:
        import starlette  # noqa: F401  # pyright: ignore[reportUnusedImport]
        import uvicorn  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ModuleNotFoundError as error:
        raise PageError(f"{error.name} is not installed; the page needs it: pip install starlette uvicorn") from None


def serve(
    build: Build,
    listener: socket.socket,
    token: str | None,
    *,
    users: PageUsers | None = None,
    certificate: tuple[Path, Path] | None = None,
) -> None:
    """Serve the page for `build` on a socket that listens until Ctrl-C.

    With `certificate` (certificate and key files), by HTTPS. Raises PageError.
    """
    check_installed()
    import uvicorn

    from .page_server import page_app
    from .timed_protocol import TimedProtocol, encrypted_protocol

    protocol = TimedProtocol if certificate is None else encrypted_protocol(tls_context(*certificate))
    begin_log()
    most = max(min(MOST_CONNECTIONS, allow_many_files() - OTHER_FILES), BACKLOG)
    config = uvicorn.Config(
        page_app(build, token, users),
        http=protocol,
        ws="none",
        backlog=BACKLOG,
        limit_concurrency=most + 1,
        log_config=None,
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=2,
    )
    uvicorn.Server(config).run([listener])


def tls_context(cert: Path, key: Path) -> ssl.SSLContext:
    """Return what HTTPS needs of a certificate and its key (PEM). Raises PageError if they cannot be used."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(cert, key, password="")
    except ssl.SSLError as error:
        reason = error.reason or "the key cannot be read"
        raise PageError(
            f"{cert}, {key}: a certificate and its key are needed, in PEM format and without password: {reason}"
        ) from None
    except OSError as error:
        raise PageError(f"{cert}, {key}: the certificate or its key cannot be read: {error.strerror}") from None
    return context


def listen(host: str, port: int, hint: str) -> socket.socket:
    """Return a socket that listens at the port, for 0 at a free one.

    Raises PageError with the hint if it is not possible to listen there.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:  # `create_server` says the address once more behind the reason
        reason = str(error.strerror or error).partition(" (while")[0]
        raise PageError(f"{host}:{port}: cannot listen there: {reason}; {hint}") from None


@contextmanager
def served_beside(build: Path, port: int) -> Generator[str]:
    """Serve the page from a child process on this machine's loopback address, and yield the page's address.

    The child ends with this process, however that ends, and cannot slow it down. Raises PageError if the port is taken
    or a package is not installed, BuildError for the build.
    """
    check_installed()
    needed_plan(read_build(build), str(build))
    listen(_LOOPBACK, port, "--page-port takes another").close()
    process = start_child(
        "pzctl.daemon.page.page_process",
        [str(build.resolve()), str(port)],
        sys.stderr.buffer,
        stdout=subprocess.PIPE,
        environment={},
    )
    try:
        told = cast(IO[bytes], process.stdout).readline().strip()
        if not told:
            raise PageError("the page's process ended before it could serve the page; its last lines say why")
        yield f"http://{_LOOPBACK}:{int(told)}/"
    finally:
        end_child(process)


def main() -> None:
    """Serve the page until the parent process ends; print the number of the port as soon as it is open."""
    end_with_parent()
    try:
        build = read_build(Path(sys.argv[1]))
        with listen(_LOOPBACK, int(sys.argv[2]), "--page-port takes another") as listener:
            print(listener.getsockname()[1], flush=True)
            os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # nobody reads standard output from here on
            serve(build, listener, None)
    except PzctlError as error:
        print(f"page: {error}", file=sys.stderr)
        sys.exit(error.exit_status)


if __name__ == "__main__":
    main()
