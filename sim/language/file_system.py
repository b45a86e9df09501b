"""The instrument's file system: floppy, RAM and flash disk, with directories (PM p.112-118, 239-245, 406-423, 462)."""

from dataclasses import dataclass, field

from .messages import CommandError

READ_BLOCK = 16_384
"""Most bytes that one READ? returns or one WRITE accepts."""

STEM_LIMIT, NAME_LIMIT, DIRECTORY_LIMIT = 8, 12, 8
"""Length of a name without and with its extension, and of a directory's name; longer names are truncated."""

DEVICES = ("DISK", "MEMO", "FLASH")


@dataclass
class Device:
    """One storage device. Paths begin at the root, names joined by a backslash; `""` is the root."""

    files: dict[str, bytes] = field(default_factory=dict[str, bytes])
    directories: set[str] = field(default_factory=lambda: {""})
    current: str = ""


@dataclass
class FileSystem:
    """Files by storage device; one file may be open for reading and one for writing."""

    devices: dict[str, Device] = field(default_factory=lambda: {name: Device() for name in DEVICES})
    reading: tuple[bytes, int] | None = None
    """The content that is being read, and the position in it."""
    writing: tuple[str, str, bytes] | None = None
    """Device, path and the content so far."""

    def power_off(self) -> None:
        """Drop open files and the RAM disk."""
        self.reading = self.writing = None
        self.devices["MEMO"] = Device()
        for device in self.devices.values():
            device.current = ""

    def save(self, device: str, name: str, content: bytes, replace: bool = False) -> None:
        """Write a file. Raises CommandError for a bad name, and for one that exists unless `replace`."""
        path = self._path(device, name)
        found = self._found(device, path)
        if found is not None and not replace:
            raise CommandError(-257)
        self.devices[device].files[found or path] = content

    def content(self, device: str, name: str) -> bytes:
        """Return a file. Raises CommandError where there is none of this name."""
        found = self._found(device, self._path(device, name))
        if found is None:
            raise CommandError(-256)
        return self.devices[device].files[found]

    def size(self, device: str, name: str) -> int:
        """Return the size of a file in bytes; -1 for a directory or a missing file (PM p.245)."""
        if name.endswith("\\"):
            return -1
        found = self._found(device, self._path(device, name))
        return -1 if found is None else len(self.devices[device].files[found])

    def purge(self, device: str, name: str) -> None:
        """Remove a file, or an empty directory. Raises CommandError where there is none of this name."""
        path = self._path(device, name)
        found = self._found(device, path)
        if found is not None:
            del self.devices[device].files[found]
        elif path in self.devices[device].directories:
            self.devices[device].directories.discard(path)
        else:
            raise CommandError(-256)

    def names(self, device: str) -> list[str]:
        """Return the names in the current directory in order; directories end with a backslash."""
        medium = self.devices[device]
        inside = [d for d in medium.directories if d and _parent(d) == medium.current]
        names = [_name(d) + "\\" for d in inside] + [_name(f) for f in medium.files if _parent(f) == medium.current]
        return ["..\\"] * bool(medium.current) + sorted(names)

    def directory(self, device: str) -> str:
        r"""CWD?: return the current directory, as `\TEST`."""
        return self.devices[device].current or "\\"

    def make_directory(self, device: str, name: str) -> None:
        """CRED: create a directory. Raises CommandError for a bad name and for one that exists."""
        path = self._path(device, name, DIRECTORY_LIMIT)
        if path in self.devices[device].directories or self._found(device, path) is not None:
            raise CommandError(-257)
        self.devices[device].directories.add(path)

    def change_directory(self, device: str, name: str) -> None:
        r"""CHAD: `..` is the parent directory, `\` the root. Raises CommandError where there is none of this name."""
        medium = self.devices[device]
        if name == "..":
            medium.current = _parent(medium.current)
        elif name == "\\":
            medium.current = ""
        else:
            path = self._path(device, name, DIRECTORY_LIMIT)
            if path not in medium.directories:
                raise CommandError(-256)
            medium.current = path

    def format(self, device: str) -> None:
        """INID: delete every file of the device."""
        self.devices[device] = Device()

    def open_to_read(self, device: str, name: str) -> None:
        """ROPEN: open a file for reading. Raises CommandError where there is none of this name."""
        self.reading = (self.content(device, name), 0)

    def read(self) -> bytes:
        """READ?: return the next bytes, empty after the last. Raises CommandError where no file is open."""
        if self.reading is None:
            raise CommandError(-250)
        content, at = self.reading
        self.reading = (content, at + READ_BLOCK)
        return content[at : at + READ_BLOCK]

    def open_to_write(self, device: str, name: str) -> None:
        """WOPEN: open a file for writing, replacing an old one of this name. Raises CommandError for a bad name."""
        self.save(device, name, b"", replace=True)
        self.writing = (device, name, b"")

    def write(self, data: bytes) -> None:
        """WRITE: append to the file that is open. Raises CommandError where none is, or too much comes at once."""
        if self.writing is None:
            raise CommandError(-250)
        device, name, so_far = self.writing
        if len(data) > READ_BLOCK or len(so_far) + len(data) > 1 << 22:
            raise CommandError(-223)
        self.writing = (device, name, so_far + data)

    def close(self) -> None:
        """CLOSE: store the written file. Raises CommandError where a file was not read to its end."""
        if self.writing is not None:
            device, name, content = self.writing
            self.save(device, name, content, replace=True)
        unread = self.reading is not None and self.reading[1] < len(self.reading[0])
        self.reading = self.writing = None
        if unread:
            raise CommandError(-250)

    def _path(self, device: str, name: str, limit: int = NAME_LIMIT) -> str:
        """Return the path of a name, which may include a directory. Raises CommandError for a bad name."""
        above, _, last = name.rpartition("\\")
        named = "\\" + above.strip("\\") if above else ""
        parent = named if "\\" in name else self.devices[device].current
        stem, dot, extension = last.partition(".")
        cut = last[:limit] if not dot else f"{stem[:STEM_LIMIT]}.{extension}"[:limit]
        if not stem or parent not in self.devices[device].directories or any(c in cut for c in '/:*?"<>|'):
            raise CommandError(-257)
        return f"{parent}\\{cut}"

    def _found(self, device: str, path: str) -> str | None:
        """Return the path of a file as it is stored: names are not case-sensitive."""
        return next((kept for kept in self.devices[device].files if kept.upper() == path.upper()), None)


def _parent(path: str) -> str:
    return path.rpartition("\\")[0]


def _name(path: str) -> str:
    return path.rpartition("\\")[2]
