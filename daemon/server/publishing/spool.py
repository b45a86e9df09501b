"""Events that wait for the journal, in files of the data folder."""

import os
from pathlib import Path

import msgspec

from ...journal.store import JournalError
from ...wire.events import AnyEvent, Event, Payload, encode

_FORM = ".event"


class Spool:
    """A queue of events that outlives this process. Raises JournalError if its files cannot be written or read."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._waiting = sorted(folder.glob(f"*{_FORM}"))

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, event: Event, payload: Payload) -> None:
        """Append an event to the queue, synced to disk. Raises WireError if the journal would refuse it."""
        header = encode(event, payload)[1]
        number = int(self._waiting[-1].stem) + 1 if self._waiting else 0
        path = self._folder / f"{number:09d}{_FORM}"
        part = path.with_suffix(".part")
        try:
            self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            with part.open("wb") as file:
                file.write(msgspec.msgpack.encode((header, payload)))
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except OSError as error:
            raise JournalError(f"{path}: an event that waits for the journal cannot be kept: {error}") from error
        self._waiting.append(path)

    def first(self) -> tuple[AnyEvent, Payload]:
        """Return the oldest event."""
        try:
            header, payload = _form.decode(self._waiting[0].read_bytes())
            return _event.decode(header), payload
        except (OSError, msgspec.MsgspecError) as error:
            raise JournalError(
                f"{self._waiting[0]}: an event that waits for the journal cannot be read: {error}"
            ) from error

    def drop(self) -> None:
        """Remove the oldest event, which is in the journal now."""
        self._waiting.pop(0).unlink(missing_ok=True)


_form = msgspec.msgpack.Decoder(tuple[bytes, tuple[bytes, ...]])
_event = msgspec.json.Decoder(AnyEvent)
