"""The process that serves the page, until Ctrl-C or for as long as the daemon that started it runs.

python -m pzctl.daemon.page.page_process BUILD.toml PORT
"""

import os
import socket
import ssl
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from ...models.base.errors import PzctlError
from ...models.build import Build
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
    host: str,
    port: int,
    token: str | None,
    *,
    users: PageUsers | None = None,
    certificate: tuple[Path, Path] | None = None,
) -> None:
    """Serve the page for `build` until Ctrl-C; with `certificate` (certificate and key files), by HTTPS.

    Raises PageError.
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
        host,
        port,
        http=protocol,
        ws="none",
        backlog=BACKLOG,
        limit_concurrency=most + 1,
        log_config=None,
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=2,
    )
    try:
        uvicorn.Server(config).run()
    except SystemExit:  # uvicorn exits after logging the reason
        raise PageError(f"{host}:{port}: cannot listen there; is the port taken? --port takes another") from None


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


def free_port(host: str, port: int, hint: str) -> int:
    """Return the port, or for 0 a free one. Raises PageError with the hint if it is not possible to listen there."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family) as trial:
            if os.name == "posix":  # as uvicorn does, so that a port closed just now counts as free
                trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(address)
            return int(trial.getsockname()[1])
    except OSError as error:
        raise PageError(f"{host}:{port}: cannot listen there: {error.strerror or error}; {hint}") from None


@contextmanager
def served_beside(build: Path, port: int) -> Generator[str]:
    """Serve the page from a child process on this machine's loopback address, and yield the page's address.

    The child ends with this process, however that ends, and cannot slow it down. Raises PageError if the port is taken
    or a package is not installed, BuildError for the build.
    """
    check_installed()
    read_build(build)
    port = free_port(_LOOPBACK, port, "--page-port takes another")
    process = start_child(
        "pzctl.daemon.page.page_process",
        [str(build.resolve()), str(port)],
        sys.stderr.buffer,
        stdout=sys.stderr.buffer,
        environment={},
    )
    try:
        yield f"http://{_LOOPBACK}:{port}/"
    finally:
        end_child(process)


def main() -> None:
    """Serve the page until the parent process ends."""
    end_with_parent()
    try:
        serve(read_build(Path(sys.argv[1])), _LOOPBACK, int(sys.argv[2]), None)
    except PzctlError as error:
        print(f"page: {error}", file=sys.stderr)
        sys.exit(error.exit_status)


if __name__ == "__main__":
    main()
