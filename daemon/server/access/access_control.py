"""Who may do what: every client by its key, from this machine as from others."""

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
"""The ZAP domain of both sockets; enforced, so that without an authenticator nobody comes in."""

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
"""What else is asked needs the right to watch."""


def _today() -> date:
    return datetime.now(UTC).date()


class AccessControl:
    """Lets in those whose keys are in the folder; a key that is taken away, changed or made counts at once.

    Programs of this account on this machine come in with the key of `daemon.json`. With `outside`, the daemon can be
    reached from other machines: that needs a server key made on purpose, and clients.
    """

    def __init__(self, folder: Path, *, outside: bool, today: Callable[[], date] = _today) -> None:
        own = local_keys(folder)
        self.server: KeyPair = server_key(folder) if outside or (folder / "server.json").exists() else own.server
        self.local = ClientKey(self.server.public, own.client.public, own.client.secret)
        """For those who can read this user's files: the commands and fitters on this machine."""
        self._folder = KeyFolder(folder)
        self._today = today
        self._admitted: set[str] = set()
        self._barred = False
        if outside and not self._clients():
            raise KeyFileError(
                f"{folder / 'clients'}: nobody may come in yet; make a key with `pzctl keys client NAME`"
            )

    def start(self, context: zmq.asyncio.Context) -> AsyncioAuthenticator:
        """Begin to check keys; to be stopped before the context ends."""
        authenticator = AsyncioAuthenticator(context)
        authenticator.start()
        authenticator.configure_curve_callback(domain=DOMAIN, credentials_provider=self)
        return authenticator

    def callback(self, domain: str, key: bytes) -> bool:
        """Return whether a key may come in; called by the authenticator."""
        allowed = self.allows(key.decode())
        if not allowed:
            log.warning("a key that is not known was turned away: %s", key.decode())
        return allowed

    def allows(self, key: str | None) -> bool:
        """Return whether a key may come in now."""
        who = self._who(key or "")
        return who is not None and not self._has_expired(who)

    def somebody_was_barred(self) -> bool:
        """Return whether a key was taken away, or expired, since this was last asked."""
        self._clients()
        barred, self._barred = self._barred, False
        return barred

    def check(self, key: str | None, request: ask.Request) -> str:
        """Return the name of the client who asks with this key. Raises RequestError where it may not ask for this."""
        who = self._who(key or "")
        needed = NEEDED.get(type(request), "watch")
        if isinstance(request, ask.HelloRequest) and request.fitter is not None:
            needed = "measure"  # who comes as a fitter is waited for
        if who is None:
            raise RequestError("not-allowed", "this key has been revoked", "ask who runs the daemon for a new one")
        if self._has_expired(who):
            raise RequestError(
                "not-allowed",
                f"the key of {who.name!r} expired after {who.expires}",
                "ask who runs the daemon for a new one",
            )
        if RIGHTS.index(who.right) < RIGHTS.index(needed):
            raise RequestError(
                "not-allowed",
                f"{who.name!r} has the right to {who.right}; {request.__struct_config__.tag!r} needs {needed!r}",
            )
        return who.name

    def _who(self, key: str) -> AllowedClient | None:
        if key == self.local.public:
            return AllowedClient(LOCAL, key, "admin")
        return self._clients().get(key)

    def _has_expired(self, client: AllowedClient) -> bool:
        return client.expires is not None and self._today() > client.expires

    def _clients(self) -> dict[str, AllowedClient]:
        """Return the clients by public key, as their files are now."""
        known = self._folder.clients()
        admitted = {key for key, client in known.items() if not self._has_expired(client)}
        self._barred |= bool(self._admitted - admitted)
        self._admitted = admitted
        return known
