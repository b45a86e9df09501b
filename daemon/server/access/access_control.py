"""The rights of clients, each identified by its key, on this machine as on others."""

import logging
from collections.abc import Callable, Mapping
from datetime import UTC, date, datetime
from pathlib import Path

import zmq
import zmq.asyncio
from zmq.auth.asyncio import AsyncioAuthenticator

from ...wire import requests as ask
from ...wire.curve_keys import (
    LOCAL,
    RIGHTS,
    AllowedClient,
    ClientKey,
    KeyFileError,
    KeyPair,
    Right,
    local_keys,
    server_key,
)
from ..requests.request_errors import RequestError
from .key_folder import KeyFolder

log = logging.getLogger(__name__)

DOMAIN = "pzctl"
"""The ZAP domain of both sockets; libzmq enforces it, so that nobody has access without an authenticator."""

NEEDED: Mapping[type[ask.Request], Right] = {
    ask.MeasureRequest: "measure",
    ask.CancelRequest: "measure",
    ask.LeaseRequest: "measure",
    ask.ReleaseRequest: "measure",
    ask.FitRequest: "measure",
    ask.DiagnoseRequest: "measure",
    ask.SubmitRequest: "measure",
    ask.BenchRequest: "bench",
    ask.ShutdownRequest: "admin",
}
"""The right that each request needs; all others need the right to watch."""


def _today() -> date:
    return datetime.now(UTC).date()


class AccessControl:
    """Admits the clients whose keys are in the folder; changes in the folder take effect at once.

    Programs of this user account on this machine use the key in `daemon.json`. With `outside`, the daemon can be
    reached from other machines, which needs a server key made for the purpose, and clients.
    """

    def __init__(self, folder: Path, *, outside: bool, today: Callable[[], date] = _today) -> None:
        generated = local_keys(folder)
        has_server_key = outside or (folder / "server.json").exists()
        self.server: KeyPair = server_key(folder) if has_server_key else generated.server
        self.local = ClientKey(self.server.public, generated.client.public, generated.client.secret)
        """Key for programs that can read this user's files: the commands and fitters on this machine."""
        self._folder = KeyFolder(folder)
        self._today = today
        self._admitted: set[str] = set()
        self._barred = False
        if outside and not self._clients():
            raise KeyFileError(
                f"{folder / 'clients'}: no client has access yet; make a key with `pzctl keys client NAME`"
            )

    def start(self, context: zmq.asyncio.Context) -> AsyncioAuthenticator:
        """Start checking keys and return the authenticator, which has to be stopped before the context ends."""
        authenticator = AsyncioAuthenticator(context)
        authenticator.start()
        authenticator.configure_curve_callback(domain=DOMAIN, credentials_provider=self)
        return authenticator

    def callback(self, domain: str, key: bytes) -> bool:
        """Return whether a key has access; called by the authenticator."""
        allowed = self.allows(key.decode())
        if not allowed:
            log.warning("an unknown or expired key was refused: %s", key.decode())
        return allowed

    def allows(self, key: str | None) -> bool:
        """Return whether a key has access now."""
        who = self._who(key or "")
        return who is not None and not self._has_expired(who)

    def somebody_was_barred(self) -> bool:
        """Return whether a key was revoked or expired since the last call."""
        self._clients()
        barred, self._barred = self._barred, False
        return barred

    def check(self, key: str | None, request: ask.Request) -> str:
        """Return the name of the client with this key. Raises RequestError if it lacks the right to this request."""
        who = self._who(key or "")
        needed = NEEDED.get(type(request), "watch")
        if isinstance(request, ask.HelloRequest) and request.fitter is not None:
            needed = "measure"  # because clients wait for the answers of a fitter
        if who is None:
            raise RequestError(
                "not-allowed", "this key has been revoked", "ask the daemon's administrator for a new one"
            )
        if self._has_expired(who):
            raise RequestError(
                "not-allowed",
                f"the key of {who.name!r} expired after {who.expires}",
                "ask the daemon's administrator for a new one",
            )
        if RIGHTS.index(who.right) < RIGHTS.index(needed):
            raise RequestError(
                "not-allowed",
                f"{who.name!r} has the right to {who.right}; {request.__struct_config__.tag!r} needs {needed!r}",
            )
        return who.name

    def may_use(self, client: str, analyzer: str) -> bool:
        """Return whether the client of this name may use an analyzer."""
        keys = [known for known in self._clients().values() if known.name == client]
        return client == LOCAL or any(known.may_use(analyzer) for known in keys)

    def _who(self, key: str) -> AllowedClient | None:
        if key == self.local.public:
            return AllowedClient(LOCAL, key, "admin")
        return self._clients().get(key)

    def _has_expired(self, client: AllowedClient) -> bool:
        return client.expires is not None and self._today() > client.expires

    def _clients(self) -> dict[str, AllowedClient]:
        """Return the clients in the folder by public key."""
        known = self._folder.clients()
        admitted = {key for key, client in known.items() if not self._has_expired(client)}
        self._barred |= bool(self._admitted - admitted)
        self._admitted = admitted
        return known
