"""The instrument's file system: memory disk and flash, files written, read in blocks, removed (reference 2.9)."""

from dataclasses import dataclass, field

from .messages import CommandError

READ_BLOCK = 16_384
"""Bytes that one READ? gives at most."""

NAME_LIMIT = 32


@dataclass
class FileSystem:
    """Files by storage device and name; one file may be open for reading and one for writing."""

    files: dict[str, dict[str, bytes]] = field(default_factory=lambda: {"MEMO": {}, "FLASH": {}, "DISK": {}})
    reading: tuple[bytes, int] | None = None
    """The content that is being read, and the position in it."""
    writing: tuple[str, str, bytes] | None = None
    """Device, name and the content so far."""

    def power_off(self) -> None:
        """Lose all files outside the flash memory."""
        self.close()
        self.files = {"MEMO": {}, "FLASH": self.files["FLASH"], "DISK": {}}

    def save(self, device: str, name: str, content: bytes, replace: bool = False) -> None:
        """Write a file. Raises CommandError for a bad name, and for one that exists unless `replace`."""
        if not name or len(name) > NAME_LIMIT or any(c in name for c in '\\/:*?"<>|'):
            raise CommandError(-257, "FILE NAME ERROR")
        if name in self.files[device] and not replace:
            raise CommandError(-257, "FILE NAME ERROR; FILE EXISTS")
        self.files[device][name] = content

    def content(self, device: str, name: str) -> bytes:
        """Return a file. Raises CommandError where there is none of this name."""
        if name not in self.files[device]:
            raise CommandError(-256, "FILE NAME NOT FOUND")
        return self.files[device][name]

    def purge(self, device: str, name: str) -> None:
        """Remove a file. Raises CommandError where there is none of this name."""
        self.content(device, name)
        del self.files[device][name]

    def names(self, device: str) -> list[str]:
        """Return the names in order."""
        return sorted(self.files[device])

    def open_to_read(self, device: str, name: str) -> None:
        """ROPEN. Raises CommandError where there is none of this name."""
        self.reading = (self.content(device, name), 0)

    def read(self) -> bytes:
        """READ?: return the next bytes, empty after the last. Raises CommandError where no file is open."""
        if self.reading is None:
            raise CommandError(-250, "MASS STORAGE ERROR; NO FILE IS OPEN")
        content, at = self.reading
        self.reading = (content, at + READ_BLOCK)
        return content[at : at + READ_BLOCK]

    def open_to_write(self, device: str, name: str) -> None:
        """WOPEN. Raises CommandError for a bad name or one that exists."""
        self.save(device, name, b"")
        self.writing = (device, name, b"")

    def write(self, data: bytes) -> None:
        """WRITE: append to the file that is open. Raises CommandError where none is."""
        if self.writing is None:
            raise CommandError(-250, "MASS STORAGE ERROR; NO FILE IS OPEN")
        device, name, so_far = self.writing
        if len(so_far) + len(data) > 1 << 22:
            raise CommandError(-254, "MEDIA FULL")
        self.writing = (device, name, so_far + data)

    def close(self) -> None:
        """CLOSE: what was written is a file now."""
        if self.writing is not None:
            device, name, content = self.writing
            self.files[device][name] = content
        self.reading = self.writing = None
