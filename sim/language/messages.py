"""Splits bytes into program messages, and messages into units (PM p.29, p.256).

A message ends with a newline, units are separated by `;`, a mnemonic is separated from its parameters by a space and
parameters by commas. Strings are in double or single quotes; a block is `#`, one digit, that many digits of
byte count, and the bytes.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from .error_texts import TEXTS

MESSAGE_LIMIT = 1 << 20
"""Most bytes of a message; the longest legitimate one (801 complex doubles as ASCII) has about 40 000."""

BLANK = b" \t\r\n\0"


class CommandError(Exception):
    """An error for the instrument's error queue: a number and its text."""

    def __init__(self, number: int) -> None:
        super().__init__(f'{number},"{TEXTS[number]}"')
        self.number = number


@dataclass(frozen=True)
class Unit:
    """One command or query."""

    mnemonic: str
    """Upper case, without the question mark."""
    query: bool
    arguments: tuple[bytes, ...] = ()
    """As sent: strings with their quotes, blocks with their header."""

    @property
    def header(self) -> str:
        """The mnemonic as it was sent, with the question mark of a query."""
        return self.mnemonic + ("?" if self.query else "")


class Framer:
    """Cuts a stream of bytes into program messages; a newline within a block does not end a message."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield each complete message, without its end.

        Raises CommandError where a message exceeds MESSAGE_LIMIT; its bytes so far are dropped.
        """
        self._pending += data
        while (end := _end_of_message(self._pending)) is not None:
            message = bytes(self._pending[:end])
            del self._pending[: end + 1]
            yield message.removesuffix(b"\r")
        if len(self._pending) > MESSAGE_LIMIT:
            self._pending.clear()
            raise CommandError(-223)


def _end_of_message(data: bytearray) -> int | None:
    """Return the position of the newline that ends the first message, None if it has not arrived yet."""
    at = 0
    while True:
        newline = data.find(b"\n", at)
        block = data.find(b"#", at, None if newline < 0 else newline)
        if block < 0 or not _parameter_starts(data, block):
            if block < 0:
                return None if newline < 0 else newline
            at = block + 1
            continue
        length = _block_length(data, block)
        at = block + 1 if length is None else block + length
        if at > len(data):
            return None


def _parameter_starts(data: bytes | bytearray, at: int) -> bool:
    return at > 0 and data[at - 1 : at] in (b" ", b",")


def _block_length(data: bytes | bytearray, at: int) -> int | None:
    """Return the size of the block at `at` including its header, None if it is not a block."""
    digits = data[at + 1 : at + 2]
    if not digits.isdigit() or digits == b"0":
        return None
    count = bytes(data[at + 2 : at + 2 + int(digits)])
    if len(count) < int(digits) or not count.isdigit():
        return None
    return 2 + int(digits) + int(count)


def parse(message: bytes) -> Iterator[Unit]:
    """Yield the units of a message in order. Raises CommandError at the first that cannot be read."""
    for part in _split(message, b";"):
        if text := part.lstrip(BLANK):
            yield _unit(text)


def _unit(text: bytes) -> Unit:
    head, _, rest = text.partition(b" ")
    head = head.rstrip(BLANK)
    query = head.endswith(b"?")
    mnemonic = head[:-1] if query else head
    _check_mnemonic(mnemonic)
    arguments = tuple(_trimmed(a) for a in _split(b" " + rest, b",")) if rest.strip(BLANK) else ()
    return Unit(mnemonic.decode("ascii").upper(), query, arguments)


def _trimmed(argument: bytes) -> bytes:
    """Return a parameter without surrounding blanks; the bytes of a block are kept unchanged."""
    argument = argument.lstrip(BLANK)
    length = _block_length(argument, 0) if argument[:1] == b"#" else None
    if length is not None and not argument[length:].strip(BLANK):
        return argument[:length]
    return argument.rstrip(BLANK)


MNEMONIC_LIMIT = 12
"""Longest mnemonic in characters; in a tree (`:PROG:DEF`) this holds for each level."""

_STARRED = re.compile(rb"\*[A-Za-z]{3}[0-9]+")
_MNEMONIC = re.compile(rb"\*?[A-Za-z][A-Za-z0-9_]*|:?[A-Za-z0-9]+(:[A-Za-z0-9]+)*")


def _check_mnemonic(word: bytes) -> None:
    """Raise CommandError where this cannot be a mnemonic (examples of Appendix D: `*SRE4`, `MEAS&IRIM`)."""
    if _STARRED.fullmatch(word):
        raise CommandError(-111)
    if _MNEMONIC.fullmatch(word) is None:
        raise CommandError(-101)
    if max(map(len, word.split(b":"))) > MNEMONIC_LIMIT:
        raise CommandError(-112)


def _split(text: bytes, separator: bytes) -> Iterator[bytes]:
    """Split at the separator, but not within strings or blocks."""
    start = at = 0
    while at < len(text):
        byte = text[at : at + 1]
        if byte in (b'"', b"'"):
            end = text.find(byte, at + 1)
            if end < 0:
                raise CommandError(-151)
            at = end + 1
        elif byte == b"#" and _parameter_starts(text, at):
            at += _block_length(text, at) or 1
        elif byte == separator:
            yield text[start:at]
            start = at = at + 1
        else:
            at += 1
    yield text[start:]


def unquote(argument: bytes) -> str:
    """Return the text of a string parameter. Raises CommandError where it is not quoted."""
    if argument[:1] not in (b'"', b"'"):
        raise CommandError(-148)
    if len(argument) < 2 or argument[-1:] != argument[:1]:
        raise CommandError(-151)
    return argument[1:-1].decode("latin-1")


def block_bytes(argument: bytes) -> bytes:
    """Return the bytes of a block parameter. Raises CommandError where it is not a block or is incomplete."""
    length = _block_length(argument, 0) if argument[:1] == b"#" else None
    if length is None or length != len(argument):
        raise CommandError(-161)
    return argument[2 + int(argument[1:2]) :]
