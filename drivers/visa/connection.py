"""The connection to one instrument, which sends messages and returns complete answers, never those to earlier messages.

It does not use `resource.query`, because pyvisa discards the bytes received before a timeout. An answer awaited in
slices, to show progress or to be cancelled, would lose its head, and every later answer would be the previous one. Here
the bytes of each slice go to a buffer, and an answer ends at the newline or, in a block, at its stated length (0x0A
occurs inside blocks).
"""

import contextlib
import time
from collections.abc import Callable, Generator
from typing import Any

from pyvisa import VisaIOError
from pyvisa.constants import InterfaceType, StatusCode
from pyvisa.errors import InvalidSession

from ..base.analyzer import InstrumentError
from . import replies, service_request
from .instrument_lock import lock_instrument, unit_of
from .session import Session, hung_up, prepared, readable

SLICE_SECONDS = 0.25
"""Length of the slices in which an answer is awaited over a network; a lost connection is noticed between them."""

CHUNK_BYTES = 4096

LONGEST_LINE_BYTES = 4096
"""Greatest length of an ASCII answer."""


class ConnectionLost(InstrumentError):
    """The connection is lost; a new session may succeed."""


class Connection:
    """One VISA session, opened by `opener`, which is called again when the connection has to be renewed.

    Every failure is an InstrumentError whose sentence starts with `name`.
    """

    def __init__(
        self, name: str, opener: Callable[[], Session], timeout_seconds: float, address: str | None = None
    ) -> None:
        """`address`: that of the instrument, which is locked against other programs until `close`; None: no lock.

        Raises InstrumentError.
        """
        self.name = name
        """The instrument's name for people: the resource string."""
        self.timeout_seconds = timeout_seconds
        """Seconds to wait for a single answer."""
        self._opener = opener
        self._buffer = bytearray()
        self._doubtful = False
        self._locks = [lock_instrument(address, name)] if address is not None else []
        try:
            self._open()
        except BaseException:
            self._release()
            raise

    def close(self) -> None:
        """Close the session and release the instrument."""
        self._close_session()
        self._release()

    def lock_unit(self, idn: str) -> None:
        """Lock the instrument under its serial number as well: LAN and GPIB are two addresses of one instrument.

        `idn` is its answer to `*IDN?`. Raises InstrumentError if another program uses it.
        """
        unit = unit_of(idn)
        if unit is not None:
            self._locks.append(lock_instrument(unit, self.name))

    def _release(self) -> None:
        for lock in self._locks:
            if lock is not None:
                lock.close()

    def _close_session(self) -> None:
        for resource in (self._resource, self._bridge):
            if resource is not None:
                with contextlib.suppress(VisaIOError, OSError, InvalidSession):
                    resource.close()

    def doubt(self) -> None:
        """Renew the session before its next use, after an answer that may belong to another message."""
        self._doubtful = True

    def ask(self, message: str) -> str:
        """Send `message`, which ends with one query; return the answer's line without newline. Raises InstrumentError.

        Send commands together with a query if possible, because only an answer shows that they arrived.
        """
        with self._exchange():
            return self._line(message)

    def tell(self, message: str) -> None:
        """Send `message`, which has no answer; only the next answer shows that it arrived. Raises InstrumentError."""
        with self._exchange():
            self._send(message)

    def ask_patiently(self, message: str, seconds: float, tick: Callable[[float], None]) -> str:
        """Do the same as `ask` if the instrument may be busy for `seconds` before it answers. Raises InstrumentError.

        `tick` is called with the elapsed seconds, several times a second over a network, and may raise an exception to
        give up; the next message then gets a new session.
        """
        with self._exchange():
            return self._line(message, seconds, tick)

    def _line(self, message: str, patience: float = 0.0, tick: Callable[[float], None] = lambda _: None) -> str:
        self._send(message)
        begun = time.monotonic()
        until = begun + self.timeout_seconds + patience
        while b"\n" not in self._buffer:
            tick(time.monotonic() - begun)
            if len(self._buffer) > LONGEST_LINE_BYTES:
                raise InstrumentError(
                    f"{self.name}: the answer to {_short(message)} does not end; garbage on the line?"
                )
            self._receive(CHUNK_BYTES, until, message)
        line, _, rest = bytes(self._buffer).partition(b"\n")
        self._buffer[:] = rest
        self._nothing_left(message)
        try:
            return line.removesuffix(b"\r").decode("ascii")
        except UnicodeDecodeError:
            shown = replies.quote(line.decode("latin-1"))
            raise InstrumentError(
                f"{self.name}: the answer to {_short(message)} is {shown}; plain text is expected"
            ) from None

    def ask_block(self, message: str, most_bytes: int, digits: int) -> bytes:
        """Send `message` and return the data of the answer, a block whose head gives its length in `digits` digits.

        Raises InstrumentError if the block is malformed, longer than `most_bytes`, cut short, or does not end with a
        newline.
        """
        with self._exchange():
            return self._block(message, most_bytes, digits)

    def _block(self, message: str, most_bytes: int, digits: int) -> bytes:
        self._send(message)
        what = f"{self.name}: {_short(message)}"
        length = replies.block_length(self._exactly(2 + digits, message), digits, what)
        if length > most_bytes:
            raise InstrumentError(f"{what}: {length} bytes are announced; at most {most_bytes} are expected")
        data = self._exactly(length, message)
        end = self._exactly(1, message)
        if end != b"\n":
            raise InstrumentError(f"{what}: after {length} bytes comes {end!r}; a newline is expected")
        return data

    def status_byte(self) -> int:
        """Return the status byte, 0-255: by serial poll on GPIB, by `*STB?` elsewhere. Raises InstrumentError."""
        if self._is_gpib:
            with self._exchange():
                status = self._guarded("serial poll", self._resource.read_stb)
        else:
            status = replies.integer(self.ask("*STB?"), f"{self.name}: *STB?")
        if not 0 <= status <= 255:
            raise InstrumentError(f"{self.name}: the status byte is {status}; 0 to 255 is allowed")
        return status

    def status_byte_patiently(self, seconds: float, tick: Callable[[float], None]) -> int:
        """Return the status byte of an instrument that may be busy for `seconds` before it answers `*STB?`.

        A serial poll is answered at once. For `tick` see `ask_patiently`. Raises InstrumentError.
        """
        if self._is_gpib:
            return self.status_byte()
        return replies.integer(self.ask_patiently("*STB?", seconds, tick), f"{self.name}: *STB?")

    @property
    def hears_requests(self) -> bool:
        """Whether this connection signals service requests."""
        return self._wait is not None

    def rest(self, seconds: float) -> None:
        """Wait `seconds`, or until service is requested. Raises InstrumentError."""
        if self._wait is None:
            time.sleep(seconds)
            return
        wait = self._wait
        with self._exchange():
            self._guarded("waiting for the service request", lambda: wait(seconds))

    @contextlib.contextmanager
    def _exchange(self) -> Generator[None]:
        """Surround a message and its answer; if one fails or is interrupted, the next one gets a new session."""
        if self._doubtful:
            self._renew()
        self._doubtful = True
        yield
        self._doubtful = False

    def _renew(self) -> None:
        """Open a new session, and on GPIB clear the device, so that answers match messages. Raises InstrumentError."""
        self._buffer.clear()
        self._close_session()
        self._open()
        if self._is_gpib:
            self._guarded("device clear", self._resource.clear)

    def _open(self) -> None:
        self._resource, self._bridge = self._opener()
        self._socket = prepared(self._resource, self._bridge)
        self._wait = service_request.waiter(self._resource, self._bridge)

    def _send(self, message: str) -> None:
        data = message.encode("ascii") + b"\n"
        self._guarded(f"sending {_short(message)}", lambda: self._resource.write_raw(data))

    @property
    def _is_gpib(self) -> bool:
        return self._resource.interface_type == InterfaceType.gpib

    def _exactly(self, count: int, message: str) -> bytes:
        until = time.monotonic() + self.timeout_seconds
        while len(self._buffer) < count:
            self._receive(count - len(self._buffer), until, message)
        data = bytes(self._buffer[:count])
        del self._buffer[:count]
        return data

    def _receive(self, count: int, until: float, message: str) -> None:
        """Receive at most `count` bytes within one slice and append them to the buffer."""
        seconds = until - time.monotonic()
        if seconds <= 0:
            came = f" after {len(self._buffer)} bytes of it" if self._buffer else ""
            late = f"no answer to {_short(message)} within {self.timeout_seconds:g} s{came}"
            raise InstrumentError(f"{self.name}: {late}; is it on and set up?")
        if self._socket is not None:  # on other interfaces a slice that ends within an answer would lose bytes
            seconds = min(SLICE_SECONDS, seconds)
        # A pyvisa-py session reads what is there already; it waits here, because it would spin at a closed connection.
        direct = self._socket if self._bridge is None else None
        for resource in (self._resource, self._bridge):
            if resource is not None:
                resource.timeout = 1 if direct is not None else max(1, round(1000 * seconds))
        lost = f"{self.name}: while awaiting the answer to {_short(message)}"
        try:
            library, session = self._resource.visalib, self._resource.session
            with library.ignore_warning(session, StatusCode.success_max_count_read):
                self._buffer += library.read(session, count)[0]
        except VisaIOError as error:
            if error.error_code != StatusCode.error_timeout:
                raise ConnectionLost(f"{lost}: {_plain(error)}") from None
            if hung_up(self._socket):
                raise ConnectionLost(f"{lost}: the connection was lost") from None
            if direct is not None:
                readable(direct, seconds)
        except OSError as error:
            raise ConnectionLost(f"{lost}: {_plain(error)}") from None

    def _nothing_left(self, message: str) -> None:
        if self._buffer:
            shown = replies.quote(self._buffer.decode("latin-1"))
            raise InstrumentError(
                f"{self.name}: after the answer to {_short(message)} comes {shown}; nothing is expected"
            )

    def _guarded(self, doing: str, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except (VisaIOError, OSError, ValueError, InvalidSession) as error:
            raise ConnectionLost(f"{self.name}: {doing} failed: {_plain(error)}") from None


def _short(message: str) -> str:
    """Return `message` shortened for an error, since a message with an array would fill a page."""
    return message if len(message) <= replies.QUOTED_CHARACTERS else message[: replies.QUOTED_CHARACTERS] + "..."


def _plain(error: Exception) -> str:
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split())
