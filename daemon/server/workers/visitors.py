"""Fitters that connected by themselves: the owner of each name, until the fitter has been silent for too long."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ...wire.curve_keys import LOCAL

LEASE = 300.0
"""Seconds that a fitter stays listed after its last request."""


@dataclass(frozen=True)
class _Visitor:
    client: str
    """The name of its key."""
    heard: float


class Visitors:
    """The owners of fitter names: a name belongs to the key that said hello with it, until that fitter is gone.

    Reserved names, those of the fitters that the daemon starts and of its diagnoses, belong to the daemon's account.
    """

    def __init__(self, reserved: Iterable[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._reserved = frozenset(reserved)
        self._clock = clock
        self._known: dict[str, _Visitor] = {}

    def belongs_to_another(self, name: str, client: str) -> bool:
        """Return whether this client must not use a fitter's name."""
        if name in self._reserved:
            return client != LOCAL
        return name in self._known and self._known[name].client != client

    def heard(self, name: str, client: str) -> None:
        """Record a request of a fitter; its name belongs to this client from now on, unless it is another's."""
        if name not in self._reserved and not self.belongs_to_another(name, client):
            self._known[name] = _Visitor(client, self._clock())

    def renew(self, name: str, client: str) -> None:
        """Record a request of a client that is known as a fitter already."""
        if name in self._known:
            self.heard(name, client)

    def silent(self) -> list[str]:
        """Forget the fitters that have been silent for too long, and return their names."""
        gone = [name for name, visitor in self._known.items() if self._clock() - visitor.heard > LEASE]
        for name in gone:
            del self._known[name]
        return gone
