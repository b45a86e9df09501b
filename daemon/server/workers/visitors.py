"""Fitters that came by themselves: whose each is, when it was last heard of. Once it is gone its name is free."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ...wire.curve_keys import LOCAL

LEASE = 300.0
"""Seconds that a fitter is listed after it was last heard of."""


@dataclass(frozen=True)
class _Visitor:
    client: str
    """The name of the key that it came in with."""
    heard: float


class Visitors:
    """A name belongs to the key that said hello with it, until nothing is heard of it any more.

    The names that the daemon keeps for its own, those of the fitters that it starts and of its diagnoses, belong to
    the daemon's own account.
    """

    def __init__(self, reserved: Iterable[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._reserved = frozenset(reserved)
        self._clock = clock
        self._known: dict[str, _Visitor] = {}

    def belongs_to_another(self, name: str, client: str) -> bool:
        """Return whether a fitter's name is not this client's to use."""
        if name in self._reserved:
            return client != LOCAL
        return name in self._known and self._known[name].client != client

    def heard(self, name: str, client: str) -> None:
        """Note that a client speaks as a fitter; the name is its own from now on, unless it is somebody else's."""
        if name not in self._reserved and not self.belongs_to_another(name, client):
            self._known[name] = _Visitor(client, self._clock())

    def renew(self, name: str, client: str) -> None:
        """Note that a client which is a fitter already was heard of."""
        if name in self._known:
            self.heard(name, client)

    def silent(self) -> list[str]:
        """Forget those of whom nothing was heard for too long; return their names."""
        gone = [name for name, one in self._known.items() if self._clock() - one.heard > LEASE]
        for name in gone:
            del self._known[name]
        return gone
