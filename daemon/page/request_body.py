"""Reads the body of a command: small, in time, and one JSON object of the fields that the command has."""

import asyncio
from typing import TypeVar

import msgspec
from starlette.requests import ClientDisconnect, Request

from ...models.base.errors import PzctlError

MOST_BODY = 64 << 10
"""Bytes of a command: a fit by hand with everything chosen has a few thousand."""

BODY_SECONDS = 10.0
"""Within which the whole body has to come."""

T = TypeVar("T", bound=msgspec.Struct)


class BodyError(PzctlError):
    """A body that is not taken; `status` is the one of HTTP."""

    def __init__(self, message: str, status: int = 400) -> None:
        super().__init__(message)
        self.status = status


class NoFields(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The body of a command that needs no words: an empty object, or nothing at all."""


async def read_body(request: Request, expected: type[T]) -> T:
    """Return the body of a request. Raises BodyError where it is too long, too slow or something else.

    What does not belong there is not read further: nothing can be nested deeper than the fields are.
    """
    try:
        async with asyncio.timeout(BODY_SECONDS):
            text = await _text(request)
    except TimeoutError:
        raise BodyError(f"request: its body did not come within {BODY_SECONDS:g} s", 408) from None
    except ClientDisconnect:
        raise BodyError("request: the connection ended before its body did") from None
    try:
        return msgspec.json.decode(text or b"{}", type=expected)
    except msgspec.ValidationError as error:
        raise BodyError(f"request: {error}") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BodyError(f"request: its body is no JSON object: {error}") from None


async def _text(request: Request) -> bytes:
    """Return the bytes of a body, read no further than is allowed."""
    text = bytearray()
    async for part in request.stream():
        text += part
        if len(text) > MOST_BODY:
            raise BodyError(f"request: its body has more than {MOST_BODY} bytes; at most these are allowed", 413)
    return bytes(text)
