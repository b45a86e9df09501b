"""CURVE keys of the daemon and of its clients, in files that only their owner can read.

`keys/local.json` holds the key pair for programs of this user account, and the daemon's pair while it serves this
machine only; the daemon makes it at its first start. `keys/server.json` is the daemon's pair if other machines may
reach it. `keys/clients/NAME.json` holds a client's public key and right, and `NAME.previous.json` those of the key
before, while a rotation lasts. `make_client` and `rotate` return the content of the file that the client itself keeps.
"""

import os
import re
import stat
import tempfile
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Literal, TypeVar

import msgspec
import zmq

from ...models.base.errors import PzctlError
from .frames import LARGEST_HEADER, WireError, from_stranger, to_json

Right = Literal["watch", "measure", "bench", "admin"]
"""The right of a client; each includes the ones before it."""

RIGHTS: tuple[Right, ...] = ("watch", "measure", "bench", "admin")

T = TypeVar("T")

LOCAL = "local"
"""Name of the programs of the daemon's own account; no other client can have it."""

PREVIOUS = ".previous"
"""End of the name of the file of a client's key before the last rotation; no client's name has a dot."""

NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""Allowed names of clients, which cannot lead out of the folder."""


class KeyFileError(PzctlError):
    """A key file is missing, not valid, or readable by others."""


class KeyPair(msgspec.Struct, frozen=True):
    """A public key and its secret key, in Z85."""

    public: str
    secret: str


class AllowedClient(msgspec.Struct, frozen=True):
    """A client that has access, and its right."""

    name: str
    public: str
    right: Right
    expires: date | None = None
    """The last day (UTC) on which the key is valid; None: for ever."""
    analyzers: tuple[str, ...] | None = None
    """The analyzers that it may use; None: all."""

    def may_use(self, analyzer: str) -> bool:
        """Return whether the client may use the analyzer of this name."""
        return self.analyzers is None or analyzer in self.analyzers


class ClientKey(msgspec.Struct, frozen=True):
    """The keys that a client needs: the daemon's public key and its own pair, in Z85."""

    server: str
    public: str
    secret: str


class LocalKeys(msgspec.Struct, frozen=True):
    """The key pairs of a daemon that serves this machine only, and of this account's programs, in Z85."""

    server: KeyPair
    client: KeyPair


def local_keys(folder: Path) -> LocalKeys:
    """Return the key pairs for this machine; make them if there are none yet. Raises KeyFileError."""
    path = folder / "local.json"
    if not path.exists():
        write_secret(path, to_json(LocalKeys(new_pair(), new_pair())))
    return _parsed(path, _local, "remove it: the daemon makes a new one when it starts")


def new_pair() -> KeyPair:
    """Return a new key pair."""
    public, secret = zmq.curve_keypair()
    return KeyPair(public.decode(), secret.decode())


def make_server(folder: Path) -> KeyPair:
    """Make the daemon's key pair. Raises KeyFileError if there is one already, which its clients depend on."""
    pair = new_pair()
    write_secret(folder / "server.json", to_json(pair))
    return pair


def server_key(folder: Path) -> KeyPair:
    """Return the daemon's key pair. Raises KeyFileError."""
    return _parsed(
        folder / "server.json",
        _server,
        "restore it from a backup, or remove it, run `pzctl keys server` and rotate the key of every client",
    )


def make_client(
    folder: Path,
    name: str,
    right: Right,
    expires: date | None = None,
    analyzers: tuple[str, ...] | None = None,
) -> ClientKey:
    """Give a client access, until a day or for ever, to all analyzers or to those named; return its keys.

    Raises KeyFileError if there is a client of this name already, or no server key.
    """
    _check_client_name(name)
    server = server_key(folder)
    pair = new_pair()
    write_secret(_file(folder, name), to_json(AllowedClient(name, pair.public, right, expires, analyzers)))
    _file(folder, name + PREVIOUS).unlink(missing_ok=True)  # of an earlier client, whose file was removed by hand
    return ClientKey(server.public, pair.public, pair.secret)


def rotate(folder: Path, name: str, old_until: date, today: date, expires: date | None = None) -> ClientKey:
    """Give a client a new key with the same right; the old one remains valid until a day, and no longer than it was.

    Return its new keys. Raises KeyFileError if there is no such client, if the rotation before still lasts, or if the
    old key expires and no day is given for the new one.
    """
    _check_client_name(name)
    server = server_key(folder)
    known = [path.stem for path in client_files(folder) if not path.stem.endswith(PREVIOUS)]
    if name not in known:
        raise KeyFileError(f"client {name!r} is not known; there are {', '.join(known) or 'none'}")
    path, previous = _file(folder, name), _file(folder, name + PREVIOUS)
    old = read_client(path)
    if old.expires is not None and expires is None:
        raise KeyFileError(
            f"client {name!r}: its key expires after {old.expires}; give the new one a day too (--expires)"
        )
    if previous.exists():
        before = read_client(previous).expires
        if before is not None and before >= today:
            raise KeyFileError(
                f"client {name!r}: the key before this one is valid until {before}; rotate again after that day, or "
                f"remove {previous} to refuse it now"
            )
        previous.unlink()
    pair = new_pair()
    until = old_until if old.expires is None else min(old_until, old.expires)
    write_secret(previous, to_json(msgspec.structs.replace(old, expires=until)))
    part = path.with_suffix(".part")
    part.unlink(missing_ok=True)
    write_secret(part, to_json(AllowedClient(name, pair.public, old.right, expires, old.analyzers)))
    part.replace(path)
    return ClientKey(server.public, pair.public, pair.secret)


def admitted(files: Mapping[Path, AllowedClient]) -> dict[str, AllowedClient]:
    """Return the clients by public key, given those of their files.

    A key before a rotation counts only beside the present one, and allows no more than that.
    """
    present = {path.stem: client for path, client in files.items() if not path.stem.endswith(PREVIOUS)}
    by_key: dict[str, AllowedClient] = {}
    for client in files.values():
        now = present.get(client.name)
        if now is not None:
            right = min(client.right, now.right, key=RIGHTS.index)
            common = _both(client.analyzers, now.analyzers)
            by_key[client.public] = msgspec.structs.replace(client, right=right, analyzers=common)
    return by_key


def _both(first: tuple[str, ...] | None, second: tuple[str, ...] | None) -> tuple[str, ...] | None:
    """Return the analyzers that both allow; None: all."""
    if first is None or second is None:
        return second if first is None else first
    return tuple(name for name in first if name in second)


def clients(folder: Path) -> tuple[tuple[AllowedClient, ...], tuple[str, ...]]:
    """Return the clients that have access, by name, and a sentence for each file that cannot be used."""
    valid: dict[Path, AllowedClient] = {}
    faults: list[str] = []
    for path in client_files(folder):
        try:
            valid[path] = read_client(path)
        except KeyFileError as error:
            faults.append(str(error))
    return tuple(admitted(valid).values()), tuple(faults)


def client_files(folder: Path) -> list[Path]:
    """Return the files of the clients, sorted by name."""
    return sorted((folder / "clients").glob("*.json"))


def read_client(path: Path) -> AllowedClient:
    """Return the client of a file. Raises KeyFileError."""
    client = _parsed(path, _client, "revoke it (`pzctl keys revoke`) and make a new one (`pzctl keys client`)")
    _check_client_name(client.name)
    if client.name != path.stem.removesuffix(PREVIOUS):
        raise KeyFileError(
            f"{path}: the client in this file is called {client.name!r}; file name and client's name must agree"
        )
    return client


def revoke(folder: Path, name: str) -> None:
    """Revoke a client's access from now on, by every key. Raises KeyFileError if there is no client of this name."""
    known = [path.stem for path in client_files(folder)]  # a file that cannot be read can be removed too
    if name not in known:
        raise KeyFileError(f"client {name!r} is not known; there are {', '.join(known) or 'none'}")
    _file(folder, name + PREVIOUS).unlink(missing_ok=True)
    _file(folder, name).unlink(missing_ok=True)


def read_client_key(path: Path) -> ClientKey:
    """Return a client's own keys. Raises KeyFileError."""
    return _parsed(path, _client_key, "ask for a new one, which `pzctl keys rotate` makes")


def write_secret(path: Path, text: bytes) -> None:
    """Write a new file atomically that only its owner can read. Raises KeyFileError, also if it exists already."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise KeyFileError(f"{path.parent}: this folder cannot be made: {error.strerror}") from None
    part: Path | None = None
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".part")  # for its owner only
        part = Path(name)
        with os.fdopen(handle, "wb") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        _name_new(part, path)
    except FileExistsError:
        raise KeyFileError(f"{path} exists already; remove it first if nobody needs it any more") from None
    except OSError as error:
        raise KeyFileError(f"{path} cannot be written: {error.strerror}") from None
    finally:
        if part is not None:
            part.unlink(missing_ok=True)


def _name_new(part: Path, path: Path) -> None:
    """Give a file the name `path` as well, or instead. Raises FileExistsError if that exists, OSError."""
    try:
        path.hardlink_to(part)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        if path.exists():
            raise FileExistsError from None
        part.replace(path)


def _check_client_name(name: str) -> None:
    if not NAME.fullmatch(name):
        raise KeyFileError(f"client {name!r}: a name has 1 to 64 letters, digits, `_` and `-`")
    if name == LOCAL:
        raise KeyFileError(f"client {name!r}: this name is reserved for the daemon's own account")


def _file(folder: Path, name: str) -> Path:
    return folder / "clients" / f"{name}.json"


def _parsed(path: Path, decoder: "msgspec.json.Decoder[T]", remedy: str) -> T:
    """Return what a key file holds. Raises KeyFileError; `remedy` says what to do with one that holds no key."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_HEADER:  # opening a pipe would wait for ever
            why = "Is a directory" if stat.S_ISDIR(status.st_mode) else "it is no key file, or far too long"
            raise KeyFileError(f"{path} cannot be read: {why}; {remedy}")
        text = path.read_bytes()
    except FileNotFoundError:
        raise KeyFileError(f"there is no key {path}; `pzctl keys --help` says how to make one") from None
    except OSError as error:
        raise KeyFileError(f"{path} cannot be read: {error.strerror}") from None
    if os.name == "posix" and status.st_mode & 0o077:
        raise KeyFileError(f"{path}: others than its owner may read this key; `chmod 600` it, or make a new one")
    try:
        return from_stranger(text, decoder)
    except WireError as error:
        raise KeyFileError(f"{path} is not a key: {error}; {remedy}") from None


_server = msgspec.json.Decoder(KeyPair)
_local = msgspec.json.Decoder(LocalKeys)
_client = msgspec.json.Decoder(AllowedClient)
_client_key = msgspec.json.Decoder(ClientKey)
