"""The body of a command: a small JSON object with exactly the command's fields, received in time.

Clients that can send only the fields of a form, as Octave's `webwrite` does, may do so.
"""

import asyncio
from typing import TypeVar
from urllib.parse import parse_qsl

import msgspec
from starlette.requests import ClientDisconnect, Request

from ...models.base.errors import PzctlError
from ...models.base.strict_json import JsonFault, check_json, once_each

MOST_BODY = 64 << 10
"""Greatest number of bytes of a command; a manual fit with all choices has a few thousand."""

BODY_SECONDS = 10.0
"""Seconds within which the whole body has to arrive."""

FORM = "application/x-www-form-urlencoded"

T = TypeVar("T", bound=msgspec.Struct)


class BodyError(PzctlError):
    """A request body is refused; `status` is the HTTP status."""

    def __init__(self, message: str, status: int = 400) -> None:
        super().__init__(message)
        self.status = status


class NoFields(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The body of a command without fields: an empty object, or nothing."""


async def read_body(request: Request, expected: type[T]) -> T:
    """Return the body of a request. Raises BodyError if it is too long, too slow or not an object of these fields.

    Decoding stops at the first thing that does not fit a field, so deep nesting does no harm.
    """
    try:
        async with asyncio.timeout(BODY_SECONDS):
            text = await _text(request)
    except TimeoutError:
        raise BodyError(f"request: its body did not come within {BODY_SECONDS:g} s", 408) from None
    except ClientDisconnect:
        raise BodyError("request: the connection ended before its body did") from None
    try:
        if _is_form(request, text):
            fields = once_each(parse_qsl(text.decode(), keep_blank_values=True, strict_parsing=True))
            return msgspec.convert(fields, expected, strict=False)
        decoded = msgspec.json.decode(text or b"{}", type=expected)
        check_json(text or b"{}")
        return decoded
    except (msgspec.ValidationError, JsonFault) as error:
        raise BodyError(f"request: {error}") from None
    except (ValueError, UnicodeDecodeError) as error:  # msgspec.DecodeError is a ValueError
        raise BodyError(f"request: its body is not a JSON object: {error}") from None


def _is_form(request: Request, text: bytes) -> bool:
    """Return whether a body has the fields of a form; curl calls any body such, unless it is told otherwise."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    return kind == FORM and bool(text) and not text.lstrip().startswith((b"{", b"["))


async def _text(request: Request) -> bytes:
    """Return the bytes of a body; stop reading at the limit."""
    text = bytearray()
    async for part in request.stream():
        text += part
        if len(text) > MOST_BODY:
            raise BodyError(f"request: its body has more than the {MOST_BODY} bytes that are allowed", 413)
    return bytes(text)
