"""Seals: Ed25519 signatures over the head of the chain, kept in a file beside the journal.

The chain reveals changes by anybody who does not rewrite all of it. A seal also reveals that the chain was rewritten up
to the sealed entry, as long as the private key is kept where the journal's writers cannot read it.
"""

import os
from pathlib import Path

import msgspec
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from ....models.sweep import now_utc
from ...wire.frames import to_json
from ..store import JournalError, Store


class Seal(msgspec.Struct, frozen=True, kw_only=True):
    """A signature over the head of a chain."""

    v: int = 1
    station: str
    """Station of the chain; not signed, so that a copy under another name keeps its seals."""
    number: int
    """Number of the last sealed entry."""
    link: str
    time: str
    public_key: str
    """32 bytes, hexadecimal."""
    signature: str
    """64 bytes, hexadecimal."""

    @property
    def signed(self) -> bytes:
        """The bytes that are signed."""
        return b"pzctl journal seal\n" + to_json([self.v, self.number, self.link, self.time, self.public_key])


def make_key(private: Path) -> None:
    """Make a private key, readable by its owner only, if there is none. Raises JournalError."""
    if private.exists():
        return
    text = Ed25519PrivateKey.generate().private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    try:
        private.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with os.fdopen(os.open(private, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(text)
    except OSError as error:
        raise JournalError(f"{private}: the key cannot be written: {error.strerror}") from None


def keep_public_key(private: Path, public: Path) -> None:
    """Write the public key of a private key, if there is no file yet. Raises JournalError."""
    if public.exists():
        return
    key = _read_private(private).public_key()
    try:
        public.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        public.write_bytes(key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    except OSError as error:
        raise JournalError(f"{public}: the key cannot be written: {error.strerror}") from None


def seal_head(head: tuple[int, str], station: str, private: Path) -> Seal:
    """Sign the head of a station's chain: its number and its link. Raises JournalError."""
    key = _read_private(private)
    number, link = head
    if number == 0:
        raise JournalError("this journal is empty, so there is nothing to seal")
    public = key.public_key().public_bytes(Encoding.Raw, PublicFormat.Raw).hex()
    blank = Seal(station=station, number=number, link=link, time=now_utc(), public_key=public, signature="")
    return msgspec.structs.replace(blank, signature=key.sign(blank.signed).hex())


def _read_private(path: Path) -> Ed25519PrivateKey:
    try:
        key = load_pem_private_key(path.read_bytes(), None)
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise JournalError(f"{path}: no private key can be read from this file: {error}") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise JournalError(f"{path}: this is no Ed25519 key, which a seal needs")
    return key


def add_seal(path: Path, seal: Seal) -> None:
    """Add a seal to a file of seals, synced. Raises JournalError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with path.open("ab") as file:
            file.write(to_json(seal) + b"\n")
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise JournalError(f"{path}: the seal cannot be written: {error.strerror}") from None


def read_seals(path: Path) -> list[Seal]:
    """Return the seals of a file; none if there is no file. Raises JournalError."""
    try:
        return [_decoder.decode(line) for line in path.read_bytes().splitlines()] if path.exists() else []
    except (OSError, msgspec.MsgspecError) as error:
        raise JournalError(f"{path}: the seals cannot be read: {error}") from None


def read_public_key(path: Path) -> str:
    """Return the public key in a PEM file as a hexadecimal text. Raises JournalError."""
    try:
        key = load_pem_public_key(path.read_bytes())
    except (OSError, ValueError, UnsupportedAlgorithm) as error:
        raise JournalError(f"{path}: no public key can be read from this file: {error}") from None
    if not isinstance(key, Ed25519PublicKey):
        raise JournalError(f"{path}: this is no Ed25519 key, which a seal needs")
    return key.public_bytes(Encoding.Raw, PublicFormat.Raw).hex()


def seal_faults(store: Store, seals: list[Seal], trusted: str | None) -> list[str]:
    """Return a sentence for each seal that is not valid; `trusted` is the journal's public key, if known."""
    if not seals:
        return ["this journal has a key for seals, but no seal: its file of seals was removed"] if trusted else []
    if trusted is None:
        return [f"{len(seals)} seal(s) could not be checked: give the public key with --public-key"]
    faults: list[str] = []
    for seal in seals:
        subject = f"the seal of {seal.time} over entry {seal.number}"
        if seal.public_key != trusted or not _is_signed(seal):
            faults.append(f"{subject} was not made with this journal's key")
        elif not store.all("SELECT 1 FROM chain WHERE number = ? AND link = ?", seal.number, seal.link):
            faults.append(f"{subject} is not valid: the chain was rewritten since")
    return faults


def _is_signed(seal: Seal) -> bool:
    try:
        key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(seal.public_key))
        key.verify(bytes.fromhex(seal.signature), seal.signed)
    except (ValueError, InvalidSignature):
        return False
    return True


_decoder = msgspec.json.Decoder(Seal)
