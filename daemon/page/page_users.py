"""The page's users: a TOML file of names, rights and hashes of tokens.

A token has 192 random bits, so a plain SHA-256 is enough, neither slow nor salted. The file reveals no token.
"""

import hashlib
import hmac
import logging
import os
import secrets
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from ...models.base.errors import PzctlError
from ..wire.curve_keys import NAME

log = logging.getLogger(__name__)

Right = Literal["read", "act"]
"""`read`: see everything; `act`: also measure, stop, diagnose and fit manually."""


class PageUsersError(PzctlError):
    """The file of the page's users cannot be used, or a user cannot be added."""


class _Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    right: Right
    token_sha256: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]


class PageUser(msgspec.Struct, frozen=True):
    """The user of a request; `name` is None without a file of users."""

    name: str | None
    right: Right


def new_token() -> str:
    """Return a random token of 192 bits."""
    return secrets.token_urlsafe(24)


def digest(token: str) -> str:
    """Return the hash under which a token is stored."""
    return hashlib.sha256(token.encode()).hexdigest()


class PageUsers:
    """The users of a file. Changes of the file take effect at once; an unusable file gives nobody access."""

    def __init__(self, path: Path) -> None:
        """Read the file. Raises PageUsersError."""
        self._path = path
        self._seen = _stamp(path)
        self._entries = read_users(path)

    def of_token(self, token: str) -> PageUser | None:
        """Return the user of a token, or None. All entries are compared, so that the time taken reveals nothing."""
        self._read_again()
        shown = digest(token)
        names = [name for name, entry in self._entries.items() if hmac.compare_digest(entry.token_sha256, shown)]
        return PageUser(names[0], self._entries[names[0]].right) if names else None

    def _read_again(self) -> None:
        stamp = _stamp(self._path)
        if stamp == self._seen:
            return
        self._seen = stamp
        try:
            self._entries = read_users(self._path)
        except PageUsersError as error:
            self._entries = {}
            log.warning("nobody has access: %s", error)


def read_users(path: Path) -> dict[str, _Entry]:
    """Return the entries of a file by name. Raises PageUsersError."""
    try:
        content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = msgspec.convert(content, dict[str, _Entry])
    except OSError as error:
        raise PageUsersError(f"{path}: the page's users cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, msgspec.ValidationError) as error:
        raise PageUsersError(f"{path}: not a file of the page's users: {error}") from None
    for name in entries:
        _check_name(name)
    return entries


def add_user(path: Path, name: str, right: Right) -> str:
    """Add a user to a file, which is made if missing; return the token, which is not stored. Raises PageUsersError."""
    _check_name(name)
    if path.exists() and name in read_users(path):
        raise PageUsersError(f"{path}: user {name!r} exists already; remove that entry first to get a new token")
    token = new_token()
    text = f'[{name}]\nright = "{right}"\ntoken_sha256 = "{digest(token)}"\n\n'
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600), "a", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise PageUsersError(f"{path}: the user cannot be written: {error.strerror}") from None
    return token


def _check_name(name: str) -> None:
    if not NAME.fullmatch(name):
        raise PageUsersError(f"user {name!r}: a name has 1 to 64 letters, digits, `_` and `-`")


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size
