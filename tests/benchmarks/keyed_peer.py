"""A peer with a key that speaks CURVE (ZMTP 3.0, RFC 26) by hand: libzmq cannot send a hostile client's messages."""

import socket
from collections.abc import Iterable

from nacl.public import Box, PrivateKey, PublicKey
from nacl.utils import random
from zmq.utils import z85

from pzctl.daemon.wire.curve_keys import ClientKey

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00CURVE" + bytes(15) + b"\0" + bytes(31)
"""The greeting of both sides, here the client's with CURVE as the mechanism."""


class KeyedPeer:
    """A connection with a client's key, accepted as a socket of the given kind."""

    def __init__(self, endpoint: str, kind: bytes, key: ClientKey) -> None:
        host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
        self.link = socket.create_connection((host, int(port)), timeout=60)
        self._count = 0
        server = PublicKey(z85.decode(key.server))
        long_term, short_term = PrivateKey(z85.decode(key.secret)), PrivateKey.generate()
        try:
            self.link.sendall(GREETING)
            self._read(64)
            first = Box(short_term, server).encrypt(bytes(64), b"CurveZMQHELLO---" + self._number()).ciphertext
            self._command(b"\x05HELLO\x01\x00" + bytes(72) + bytes(short_term.public_key) + self._last + first)
            welcome = self._answer(b"\x07WELCOME")
            opened = Box(short_term, server).decrypt(welcome[16:], b"WELCOME-" + welcome[:16])
            short_server, cookie = PublicKey(opened[:32]), opened[32:]
            self._box = Box(short_term, short_server)
            at = random(16)
            vouched = bytes(short_term.public_key) + bytes(server)
            vouch = Box(long_term, short_server).encrypt(vouched, b"VOUCH---" + at).ciphertext
            about = b"\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
            inner = bytes(long_term.public_key) + at + vouch + about
            sealed = self._box.encrypt(inner, b"CurveZMQINITIATE" + self._number()).ciphertext
            self._command(b"\x08INITIATE" + cookie + self._last + sealed)
            self._answer(b"\x05READY")
        except BaseException:
            self.link.close()
            raise

    def sealed(self, frames: Iterable[tuple[bool, bytes]]) -> bytes:
        """Return the bytes on the wire of frames, each a flag whether more of the message follows, and its content."""
        said: list[bytes] = []
        for more, content in frames:
            nonce = b"CurveZMQMESSAGEC" + self._number()
            body = b"\x07MESSAGE" + self._last + self._box.encrypt(bytes([more]) + content, nonce).ciphertext
            said.append(b"\x02" + len(body).to_bytes(8, "big") + body)
        return b"".join(said)

    def _number(self) -> bytes:
        self._count += 1
        self._last = self._count.to_bytes(8, "big")
        return self._last

    def _command(self, body: bytes) -> None:
        self.link.sendall(b"\x06" + len(body).to_bytes(8, "big") + body)

    def _answer(self, name: bytes) -> bytes:
        wide = 8 if self._read(1)[0] & 2 else 1
        body = self._read(int.from_bytes(self._read(wide), "big"))
        if not body.startswith(name):
            raise ConnectionRefusedError
        return body.removeprefix(name)

    def _read(self, count: int) -> bytes:
        found = b""
        while len(found) < count:
            part = self.link.recv(count - len(found))
            if not part:
                raise ConnectionResetError
            found += part
        return found
