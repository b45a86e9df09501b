"""The requests socket: reads what comes, lets the desk answer, does nothing twice."""

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Sequence

import msgspec
import zmq.asyncio

from ..models.errors import PzctlError
from ..sim.control import bench_command
from . import replies as reply
from . import requests as ask
from .desk import Desk
from .frames import MOST_FRAMES, WireError, from_json, to_json
from .gate import Gate
from .refusals import RequestError
from .store import JournalError
from .wire import WIRE

log = logging.getLogger(__name__)

REMEMBERED = 1000
"""Answers kept, so that a request that is sent again is answered again and not done again."""

AT_ONCE = 100
"""Requests that are being answered; the next are read when one of them has been."""

ONCE = (ask.Measure, ask.Cancel, ask.Bench, ask.Fit, ask.Diagnose, ask.Lease, ask.Release)
"""Requests that change something each time they are done; the others may be answered anew."""


class Reception:
    """Answers requests for as long as `serve` runs."""

    def __init__(self, socket: zmq.asyncio.Socket, desk: Desk, gate: Gate | None) -> None:
        self._socket = socket
        self._gate = gate
        self._desk = desk
        self._done: OrderedDict[str, asyncio.Future[list[bytes]]] = OrderedDict()
        self._tasks: set[asyncio.Task[None]] = set()

    async def serve(self) -> None:
        """Answer for ever."""
        while True:
            received = await self._socket.recv_multipart(copy=False)
            key = _key(received[-1]) if self._gate else None
            sender, *frames = [frame.bytes for frame in received]
            envelope = [sender]
            if frames and not frames[0]:  # a REQ socket puts an empty frame before its request, and wants it back
                envelope.append(frames.pop(0))
            task = asyncio.create_task(self._reply(envelope, frames, key))
            self._tasks.add(task)  # the loop itself keeps no hold of a task
            task.add_done_callback(self._tasks.discard)
            await asyncio.sleep(0)  # a message that is there already is read without a pause: let others have theirs
            if len(self._tasks) >= AT_ONCE:
                await asyncio.wait(self._tasks, return_when=asyncio.FIRST_COMPLETED)

    async def _reply(self, envelope: list[bytes], frames: list[bytes], key: str | None) -> None:
        began = time.monotonic()
        answer = await self._answer(frames, key)
        self._desk.metrics.counts["requests"] += 1
        self._desk.metrics.lasted("request", time.monotonic() - began)
        await self._socket.send_multipart([*envelope, *answer])  # pyright: ignore[reportUnknownMemberType]

    async def _answer(self, frames: list[bytes], key: str | None) -> list[bytes]:
        """Return the answer's frames: whatever came, somebody who asked hears why not."""
        try:
            request = _read(frames)
            if self._gate:
                self._gate.check(key, request)
        except RequestError as error:
            self._desk.metrics.counts["refused"] += 1
            return _refusal(_id_of(frames), error.problem)
        except WireError as error:
            self._desk.metrics.counts["garbage"] += 1
            return _refusal(_id_of(frames), reply.Problem("bad-request", str(error), "see docs/wire.md"))
        if not isinstance(request, ONCE):
            return await self._carry_out(request, frames[1:])
        if request.id not in self._done:
            self._done[request.id] = asyncio.ensure_future(self._carry_out(request, frames[1:]))
            if len(self._done) > REMEMBERED:
                self._done.popitem(last=False)
        return await self._done[request.id]

    async def _carry_out(self, request: ask.AnyRequest, raw: Sequence[bytes]) -> list[bytes]:
        try:
            if isinstance(request, ask.Bench):
                answer, more = await self._bench(request), list[bytes]()
            else:
                if isinstance(request, ask.Diagnose) and request.effects:
                    _check_effects(request.effects, await self._desk.errands.effects())
                answer, more = self._desk.answer(request, raw)
                if isinstance(request, ask.Lease):
                    await self._desk.acquisition.let_go()
        except RequestError as error:
            self._desk.metrics.counts["refused"] += 1
            return _refusal(request.id, error.problem)
        except JournalError as error:
            return _refusal(request.id, reply.Problem("journal", str(error)))
        except WireError as error:
            self._desk.metrics.counts["garbage"] += 1
            return _refusal(request.id, reply.Problem("bad-request", str(error), "see docs/wire.md"))
        except Exception as error:
            log.exception("request %s", request.id)
            return _refusal(request.id, reply.Problem("defect", f"a defect of pzctl, see the daemon's log: {error!r}"))
        return [to_json(answer), *more]

    async def _bench(self, request: ask.Bench) -> reply.BenchAnswer:
        """Pass a command on to the simulator's bench. Raises RequestError."""
        if self._desk.bench is None:
            raise RequestError("no-bench", "this daemon measures with an instrument that has no simulated bench")
        if taken := sorted({"host", "port", "timeout"} & request.command.keys()):
            raise RequestError("bench-failed", f"bench: no command has a field {taken[0]!r}")
        host, _, port = self._desk.bench.rpartition(":")
        try:
            answer = await asyncio.to_thread(bench_command, host, int(port), **request.command)
        except PzctlError as error:
            raise RequestError("bench-failed", str(error)) from None
        return reply.BenchAnswer(id=request.id, answer=answer)


class _Named(msgspec.Struct):
    id: str | None = None
    request: str | None = None


NAMES = tuple(str(kind.__struct_config__.tag) for kind in ask.AnyRequest.__args__)
"""Of the requests."""

_request = msgspec.json.Decoder(ask.AnyRequest)
_named = msgspec.json.Decoder(_Named)


def _read(frames: Sequence[bytes]) -> ask.AnyRequest:
    """Return the request. Raises WireError with a sentence, whatever the bytes are."""
    if not 1 <= len(frames) <= MOST_FRAMES:
        raise WireError(f"request: {len(frames)} frame(s); 1 to {MOST_FRAMES} are allowed")
    name = from_json(frames[0], _named).request
    if name not in NAMES:
        raise WireError(f"request: {name!r} is not known; known are {', '.join(NAMES)}")
    request = from_json(frames[0], _request)
    if request.v != WIRE:
        raise WireError(
            f"request: this is pzctl wire {request.v}, and wire {WIRE} is read here: upgrade the older side"
        )
    return request


def _check_effects(asked: Sequence[str], known: frozenset[str]) -> None:
    """Raise RequestError where the catalogue has no such effect."""
    unknown = sorted({*asked} - known)
    if unknown:
        raise RequestError(
            "no-such-effect", f"effect {unknown[0]!r} is not known; there are {', '.join(sorted(known))}"
        )


def _key(frame: zmq.Frame) -> str | None:
    """Return the public key of who sent a frame, as the authenticator found it."""
    try:
        return str(frame.get("User-Id"))
    except zmq.ZMQError:
        return None


def _id_of(frames: Sequence[bytes]) -> str | None:
    """Return the id of what is no request, where it has one."""
    try:
        return from_json(frames[0], _named).id if frames else None
    except WireError:
        return None


def _refusal(request: str | None, problem: reply.Problem) -> list[bytes]:
    return [to_json(reply.Refusal(id=request, error=problem))]
