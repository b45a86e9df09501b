"""Keys of the daemon and of its clients (CURVE), as files that their owner alone can read.

`keys/local.json` has the pair of this account's own programs, and the daemon's pair for as long as it serves this
machine alone; the daemon makes it at its first start. `keys/server.json` is the daemon's pair where other machines may
reach it; `keys/clients/NAME.json` says which public key may do what; the file that `make_client` returns the content of
is what the client itself keeps.
"""

import os
import re
import stat
from datetime import date
from pathlib import Path
from typing import Literal, TypeVar

import msgspec
import zmq

from ...models.base.errors import PzctlError
from .frames import LARGEST_HEADER, WireError, from_json, to_json

Right = Literal["watch", "measure", "bench", "admin"]
"""What a client may do; each includes those before it."""

RIGHTS: tuple[Right, ...] = ("watch", "measure", "bench", "admin")

T = TypeVar("T")

LOCAL = "local"
"""What the programs of the account that runs the daemon are called; no client can be."""

NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""What a client may be called; nothing that leads out of the folder."""


class KeyFileError(PzctlError):
    """A key that is not there, that others may read, or that is no key."""


class KeyPair(msgspec.Struct, frozen=True):
    """A public key and its secret, in Z85."""

    public: str
    secret: str


class AllowedClient(msgspec.Struct, frozen=True):
    """Who may come in, and what for."""

    name: str
    public: str
    right: Right
    expires: date | None = None
    """The last day (UTC) on which the key counts; None where it always does."""


class ClientKey(msgspec.Struct, frozen=True):
    """What a client needs to come in: the daemon's public key, and its own pair; in Z85."""

    server: str
    public: str
    secret: str


class LocalKeys(msgspec.Struct, frozen=True):
    """The pairs of a daemon that serves this machine alone, and of this account's programs, in Z85."""

    server: KeyPair
    client: KeyPair


def local_keys(folder: Path) -> LocalKeys:
    """Return the pairs for this machine, made where there are none yet. Raises KeyFileError."""
    path = folder / "local.json"
    if not path.exists():
        write_secret(path, to_json(LocalKeys(new_pair(), new_pair())))
    return _parsed(path, _local)


def new_pair() -> KeyPair:
    """Return a new pair."""
    public, secret = zmq.curve_keypair()
    return KeyPair(public.decode(), secret.decode())


def make_server(folder: Path) -> KeyPair:
    """Make the daemon's pair. Raises KeyFileError where there is one: every client would have to be told anew."""
    pair = new_pair()
    write_secret(folder / "server.json", to_json(pair))
    return pair


def server_key(folder: Path) -> KeyPair:
    """Return the daemon's pair. Raises KeyFileError."""
    return _parsed(folder / "server.json", _server)


def make_client(folder: Path, name: str, right: Right, expires: date | None = None) -> ClientKey:
    """Let a client in, until a day or for ever; return its key.

    Raises KeyFileError where there is a client of this name, or no server's key.
    """
    _check_client_name(name)
    server = server_key(folder)
    pair = new_pair()
    write_secret(_file(folder, name), to_json(AllowedClient(name, pair.public, right, expires)))
    return ClientKey(server.public, pair.public, pair.secret)


def clients(folder: Path) -> tuple[tuple[AllowedClient, ...], tuple[str, ...]]:
    """Return who may come in, by name, and a sentence for each file that lets nobody in."""
    found: list[AllowedClient] = []
    faults: list[str] = []
    for path in client_files(folder):
        try:
            found.append(read_client(path))
        except KeyFileError as error:
            faults.append(str(error))
    return tuple(found), tuple(faults)


def client_files(folder: Path) -> list[Path]:
    """Return the files that say who may come in, by name."""
    return sorted((folder / "clients").glob("*.json"))


def read_client(path: Path) -> AllowedClient:
    """Return one of those who may come in. Raises KeyFileError."""
    client = _parsed(path, _client)
    _check_client_name(client.name)
    if client.name != path.stem:
        raise KeyFileError(
            f"{path}: the client in this file is called {client.name!r}; the file is named after another"
        )
    return client


def revoke(folder: Path, name: str) -> None:
    """Bar a client: it can ask for nothing from now on. Raises KeyFileError where there is none of this name."""
    known = [path.stem for path in client_files(folder)]  # one that cannot be read can be taken away all the same
    if name not in known:
        raise KeyFileError(f"client {name!r} is not known; there are {', '.join(known) or 'none'}")
    _file(folder, name).unlink()


def read_client_key(path: Path) -> ClientKey:
    """Return a client's own key. Raises KeyFileError."""
    return _parsed(path, _own)


def write_secret(path: Path, text: bytes) -> None:
    """Write a new file that its owner alone can read. Raises KeyFileError where it is there already."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise KeyFileError(f"{path.parent}: this folder cannot be made: {error.strerror}") from None
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise KeyFileError(f"{path} is there already; remove it first if nobody needs it any more") from None
    except OSError as error:
        raise KeyFileError(f"{path} cannot be written: {error.strerror}") from None
    with os.fdopen(handle, "wb") as file:
        file.write(text)


def _check_client_name(name: str) -> None:
    if not NAME.fullmatch(name):
        raise KeyFileError(f"client {name!r}: a name has 1 to 64 letters, digits, `_` and `-`")
    if name == LOCAL:
        raise KeyFileError(f"client {name!r}: this is what the daemon's own account is called")


def _file(folder: Path, name: str) -> Path:
    return folder / "clients" / f"{name}.json"


def _parsed(path: Path, decoder: "msgspec.json.Decoder[T]") -> T:
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) or found.st_size > LARGEST_HEADER:  # to open a pipe would wait for ever
            why = "Is a directory" if stat.S_ISDIR(found.st_mode) else "it is no file of a key, or far too long"
            raise KeyFileError(f"{path} cannot be read: {why}")
        text = path.read_bytes()
    except FileNotFoundError:
        raise KeyFileError(f"there is no key {path}; `pzctl keys --help` says how to make one") from None
    except OSError as error:
        raise KeyFileError(f"{path} cannot be read: {error.strerror}") from None
    if os.name == "posix" and found.st_mode & 0o077:
        raise KeyFileError(f"{path}: others than its owner may read this key; `chmod 600` it, or make a new one")
    try:
        return from_json(text, decoder)
    except WireError as error:
        raise KeyFileError(f"{path} is no key: {error}") from None


_server = msgspec.json.Decoder(KeyPair)
_local = msgspec.json.Decoder(LocalKeys)
_client = msgspec.json.Decoder(AllowedClient)
_own = msgspec.json.Decoder(ClientKey)
