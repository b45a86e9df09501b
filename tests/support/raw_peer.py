"""A peer that speaks ZMTP 3.0 by hand, byte for byte: libzmq cannot send a hostile program's messages."""

import socket

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(16) + b"\0" + bytes(31)

MORE, LARGE = b"\x01", b"\x03"
"""Flags of a frame that is not the last of its message: with one byte of length, with eight."""


def greeted(endpoint: str, kind: bytes) -> socket.socket:
    """Return a connection to a socket of the daemon after the handshake, as a socket of this kind."""
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    link = socket.create_connection((host, int(port)), timeout=60)
    body = b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
    try:
        link.sendall(GREETING + b"\x04" + bytes([len(body)]) + body)
        answer = b""
        while b"READY" not in answer:
            received = link.recv(4096)
            if not received:
                raise ConnectionResetError
            answer += received
    except (ConnectionResetError, BrokenPipeError):
        link.close()
        raise AssertionError(f"a {kind.decode()} is not let in") from None
    return link


def send_until_cut(link: socket.socket, block: bytes, most: int) -> bool:
    """Send the same bytes repeatedly, at most `most` in total; return whether the other side closed the connection."""
    try:
        for _ in range(most // len(block)):
            link.sendall(block)
    except (ConnectionResetError, BrokenPipeError):
        return True
    return False


def frames_in(block: bytes) -> list[tuple[bool, bytes]]:
    """Return the frames in plain ZMTP bytes: a flag whether more of the message follows, and the content."""
    found: list[tuple[bool, bytes]] = []
    while block:
        wide = 8 if block[0] & 2 else 1
        start = 1 + wide
        end = start + int.from_bytes(block[1:start], "big")
        found.append((bool(block[0] & 1), block[start:end]))
        block = block[end:]
    return found
