"""Who may do what: every client by its key, where the daemon can be reached from other machines."""

import logging
from collections.abc import Mapping
from pathlib import Path

import zmq
import zmq.asyncio
from zmq.auth.asyncio import AsyncioAuthenticator

from ...wire import requests as ask
from ...wire.curve_keys import RIGHTS, AllowedClient, ClientKey, KeyFileError, Right, ServerKey, clients, server_key
from ..requests.request_errors import RequestError

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


class AccessControl:
    """Lets in those whose keys are in the folder; a key that is taken away, or made, counts at once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "clients"
        self._root = folder
        self.server: ServerKey = server_key(folder)
        public, secret = zmq.curve_keypair()
        self.local = ClientKey(self.server.public, public.decode(), secret.decode())
        """For those who can read this user's files: the commands and fitters on this machine."""
        self._known: dict[str, AllowedClient] = {}
        self._read_at = -1
        self._barred = False
        if not self._clients():
            raise KeyFileError(f"{self._folder}: nobody may come in yet; make a key with `pzctl keys client NAME`")

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
        return self._who(key or "") is not None

    def somebody_was_barred(self) -> bool:
        """Return whether a key was taken away since this was last asked."""
        self._clients()
        barred, self._barred = self._barred, False
        return barred

    def check(self, key: str | None, request: ask.Request) -> None:
        """Raise RequestError where who asks with this key may not ask for this."""
        who = self._who(key or "")
        needed = NEEDED.get(type(request), "watch")
        if isinstance(request, ask.HelloRequest) and request.fitter is not None:
            needed = "measure"  # who comes as a fitter is waited for
        if who is None:
            raise RequestError("not-allowed", "this key has been revoked", "ask who runs the daemon for a new one")
        if RIGHTS.index(who.right) < RIGHTS.index(needed):
            raise RequestError(
                "not-allowed",
                f"{who.name!r} has the right to {who.right}; {request.__struct_config__.tag!r} needs {needed!r}",
            )

    def _who(self, key: str) -> AllowedClient | None:
        if key == self.local.public:
            return AllowedClient("local", key, "admin")
        return self._clients().get(key)

    def _clients(self) -> dict[str, AllowedClient]:
        """Return the clients by public key, read anew when the folder has changed."""
        changed = self._folder.stat().st_mtime_ns if self._folder.is_dir() else 0
        if changed != self._read_at:
            self._read_at = changed
            before = {*self._known}
            try:
                self._known = {one.public: one for one in clients(self._root)}
            except KeyFileError:  # one bad file must not let anybody in who was barred
                log.exception("keys")
                self._known = {}
            self._barred |= bool(before - {*self._known})
        return self._known
