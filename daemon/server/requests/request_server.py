"""The requests socket: reads requests, has them answered, and carries none out twice."""

import asyncio
import hashlib
import logging
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import msgspec
import zmq.asyncio

from ....models.base.errors import PzctlError
from ....models.base.names import among
from ....sim.bench.bench_control import bench_command
from ...journal.store import JournalError
from ...wire import replies as reply
from ...wire import requests as ask
from ...wire.events import WIRE
from ...wire.frames import LARGEST_FRAME, MOST_FRAMES, WireError, from_json, from_stranger, to_json
from ...wire.request_names import check_names
from ..access.access_control import AccessControl
from ..access.connection_guard import ConnectionGuard
from ..access.unread_answers import LITTLE, Connection, UnreadAnswers
from ..analyzers.served_analyzers import ServedAnalyzer
from .answer_memory import AnswerMemory, GivenAnswer, Said
from .request_errors import RequestError
from .request_handlers import RequestHandlers, asked_for

log = logging.getLogger(__name__)

AT_ONCE = 100
"""Greatest number of a client's requests that wait for their answers; further long ones of this client are refused."""

READ_AT_ONCE = 1000
"""The same for requests that read the journal: programs may ask for many measurements at the same time."""

LAST_ANSWERS = 2.0
"""Seconds for the answers that wait when the daemon ends."""

SLOW_READER = 0.1
"""Seconds until it is looked again whether a slow client has read enough for a further answer."""

TURN = 0.002
"""Seconds of answering after which other tasks get their turn. After 2 ms with invalid messages the server pauses for
2 ms, so that a flood does not take a whole core and valid requests are still answered soon."""

ONCE = (
    ask.MeasureRequest,
    ask.CancelRequest,
    ask.WithdrawRequest,
    ask.BenchRequest,
    ask.FitRequest,
    ask.DiagnoseRequest,
    ask.LeaseRequest,
    ask.ReleaseRequest,
)
"""Requests that must not be carried out twice; the others may simply be answered again."""

READING = (ask.SamplesRequest, ask.SweepsRequest, ask.FitsRequest, ask.ReplayRequest)
"""Requests that may read a large part of the journal, which other threads do."""

LONG = (ask.BenchRequest, ask.LeaseRequest, ask.DiagnoseRequest, *READING)
"""Requests that wait for something outside the handlers, or for a reading thread."""

LARGE = ("measure", "submit")
LARGEST_SMALL = 64 << 10
"""Greatest size in bytes of the header of any other request than these, which take the longest to check."""

LONGEST_COMMAND = 4096
"""Bytes of a command to the bench; its port reads no longer line than 64 KiB."""

MOST_TOLD = 1000
"""Greatest number of characters of a bench command that the journal keeps."""


class RequestServer:
    """Answers requests for as long as `serve` runs.

    The socket is read and written without waiting: a ROUTER drops answers that a client does not read.
    """

    def __init__(
        self, socket: zmq.asyncio.Socket, handlers: RequestHandlers, access: AccessControl, guard: ConnectionGuard
    ) -> None:
        self._coming = socket
        self._socket: zmq.Socket[bytes] = zmq.Socket(shadow=socket)
        self._access = access
        self._handlers = handlers
        self._guard = guard
        self._unread = UnreadAnswers()
        self._memory = AnswerMemory()
        self._tasks: set[asyncio.Task[None]] = set()
        self._reading: dict[tuple[str, bytes], asyncio.Future[list[bytes]]] = {}
        """The answers that are being read, by client and hash of the request: one that is sent again is read once."""
        self._askers: dict[asyncio.Future[list[bytes]], list[Connection]] = {}
        """The connections that wait for each answer that is still to come."""
        self._waiting: Counter[str | None] = Counter()
        """Number of answers that each key waits for."""
        self._listing = ThreadPoolExecutor(1, "listing")  # lists of all samples delay no fitter's sweeps
        self._looking = ThreadPoolExecutor(1, "looking")
        self._turns: defaultdict[tuple[ThreadPoolExecutor, str], asyncio.Lock] = defaultdict(asyncio.Lock)
        """Only one request of each client waits for a thread, so that clients take turns."""

    async def serve(self) -> None:
        """Answer requests until cancelled."""
        counts = self._handlers.metrics.counts
        while True:
            await self._coming.poll()
            garbage, until = counts["garbage"], time.monotonic() + TURN
            while self._answer_next() and time.monotonic() < until:
                pass
            nonsense = counts["garbage"] > garbage and time.monotonic() >= until
            await asyncio.sleep(TURN if nonsense else 0)

    async def end(self) -> None:
        """Send the answers that are still to come, if they come soon; call it when `serve` has ended."""
        if self._tasks:
            _, late = await asyncio.wait({*self._tasks}, timeout=LAST_ANSWERS)
            for task in late:
                task.cancel()
            await asyncio.gather(*late, return_exceptions=True)
        for threads in (self._listing, self._looking):
            threads.shutdown(wait=False, cancel_futures=True)

    def _answer_next(self) -> bool:
        """Answer the next request; return False if there is none."""
        received = self._receive()
        if received is None:
            return False
        began, last = time.monotonic(), received[-1]
        handle, key = _property(last, "__fd"), _property(last, "User-Id")
        descriptor = int(handle) if handle else -1
        if handle:
            self._guard.heard(descriptor)
        sender, *frames = [frame.bytes for frame in received]
        envelope = [sender]
        if frames and not frames[0]:  # a REQ socket sends an empty frame before its request, and expects it back
            envelope.append(frames.pop(0))
        waiting = self._unread.too_much(descriptor)
        if waiting and not self._unread.is_reading(descriptor):
            answer = self._why_not(_id_of(frames), _unread(waiting))
        else:
            answer = self._answer(frames, key)
        if isinstance(answer, list):
            self._send(envelope, answer, began, descriptor)
        else:
            self._waiting[key] += 1
            connection = Connection(descriptor)
            self._askers.setdefault(answer, []).append(connection)
            answer.add_done_callback(lambda done: self._askers.pop(done, None))
            later = self._send_later(envelope, answer, began, connection, _id_of(frames), key)
            task = asyncio.create_task(later)
            self._tasks.add(task)  # the event loop keeps only a weak reference
            task.add_done_callback(self._tasks.discard)
        return True

    def _receive(self) -> list[zmq.Frame] | None:
        """Return the next message, or None. Of one with too many frames, keep only the first ones and the last."""
        try:
            frames = [self._socket.recv(zmq.NOBLOCK, copy=False)]
        except zmq.Again:
            return None
        while frames[-1].more:
            following = self._socket.recv(zmq.NOBLOCK, copy=False)
            if len(frames) > MOST_FRAMES + 2:
                frames.pop()
            frames.append(following)
        return frames

    def _send(
        self,
        envelope: Sequence[bytes],
        answer: Sequence[bytes],
        began: float,
        descriptor: int,
        request: str | None = None,
    ) -> None:
        self._handlers.metrics.counts["requests"] += 1
        self._handlers.metrics.lasted("request", time.monotonic() - began)
        self._unread.answered(descriptor, sum(map(len, answer)), request)
        self._socket.send_multipart([*envelope, *answer], zmq.NOBLOCK)
        # Sending may take libzmq's notice of a request that has just come, which is given once: look again.
        self._coming.get(zmq.EVENTS)

    async def _send_later(
        self,
        envelope: Sequence[bytes],
        answer: "asyncio.Future[list[bytes]]",
        began: float,
        connection: Connection,
        request: str | None,
        key: str | None,
    ) -> None:
        """Send an answer once it is there: a large one when the client has read enough, and only once at a time."""
        try:
            says = await answer
            if sum(map(len, says)) >= LITTLE:
                try:
                    await self._room([connection])
                except RequestError as error:
                    says = self._why_not(request, error)
                if self._unread.is_underway(connection.handle, request):  # the client was impatient and asked again
                    return
            self._send(envelope, says, began, connection.handle, request)
        finally:
            self._waiting[key] -= 1

    def _answer(self, frames: Sequence[bytes], key: str | None) -> Said:
        """Return the answer to a message, which is a refusal with the reason for an invalid one."""
        try:
            request = _read(frames)
            client = self._access.check(key, request)
        except Exception as error:  # whatever reading a message raises, the next one must be answered
            return self._why_not(_id_of(frames), error)
        digest = hashlib.sha256(b"".join(frames)).digest()
        full = self._waiting[key] >= (READ_AT_ONCE if isinstance(request, READING) else AT_ONCE)
        if (given := self._memory.given(client, request.id)) is not None:
            return self._again(request, given, digest, full=full)
        refused = False
        if isinstance(request, LONG) and full:
            outcome, refused = self._why_not(request.id, _busy()), True
        elif isinstance(request, LONG):
            outcome = self._later(request, client, digest)
        else:
            try:
                answer, more = self._handlers.answer(request, frames[1:], client)
                outcome = [to_json(answer), *more]
            except Exception as error:
                outcome, refused = self._why_not(request.id, error), True
                if isinstance(error, JournalError):  # a repetition may succeed
                    return outcome
        if isinstance(request, ONCE):
            self._memory.keep(client, request.id, GivenAnswer(digest, outcome), refused=refused)
        return outcome

    def _again(self, request: ask.AnyRequest, given: GivenAnswer, digest: bytes, *, full: bool) -> Said:
        """Return the answer to a request whose id was used before."""
        if given.digest != digest:
            return self._why_not(request.id, _id_in_use(request.id))
        if (lost := self._handlers.not_kept(request)) is not None:
            return self._why_not(request.id, JournalError(lost))
        if isinstance(given.said, list) or not full:
            return given.said
        return given.said.result() if given.said.done() else self._why_not(request.id, _busy())

    def _later(self, request: ask.AnyRequest, client: str, digest: bytes) -> "asyncio.Future[list[bytes]]":
        """Return the answer to a `LONG` request; if the same one is being read for this client already, that one."""
        if not isinstance(request, READING):
            return asyncio.ensure_future(self._arrange(request, client))
        if (asked := (client, digest)) not in self._reading:
            self._reading[asked] = asyncio.ensure_future(self._arrange(request, client))
            self._reading[asked].add_done_callback(lambda _: self._reading.pop(asked))
        return self._reading[asked]

    async def _arrange(self, request: ask.AnyRequest, client: str) -> list[bytes]:
        """Answer a `LONG` request, which waits for bench, instrument, catalogue of effects or a reading thread."""
        try:
            if isinstance(request, ask.BenchRequest):
                on = self._handlers.analyzers.named(request.analyzer, client)
                on.lease.check_client(client)
                answer = await _bench(on, request, client)
                says = to_json(request.command).decode()[:MOST_TOLD]
                self._handlers.audit(asked_for(request, client, "bench", says, analyzer=on.name))
                return [to_json(answer)]
            if isinstance(request, ask.DiagnoseRequest) and request.effects:
                _check_effects(request.effects, await self._handlers.jobs.effects())
            if isinstance(request, READING):
                answer, more = await self._read_journal(request, client)
            else:
                answer, more = self._handlers.answer(request, (), client)
            if isinstance(request, ask.LeaseRequest) and request.lease is None:  # nothing is measured, so this is soon
                await self._handlers.leased(request, client).acquisition.let_go()
            header = to_json(answer)
            if len(header) > LARGEST_FRAME:
                says = f"the answer would have {len(header)} bytes; at most {LARGEST_FRAME} are allowed"
                raise RequestError("too-much", says, "ask for one sample")
            return [header, *more]
        except Exception as error:
            if isinstance(request, ONCE):
                self._memory.refuse(client, request.id, for_good=not isinstance(error, JournalError))
            return self._why_not(request.id, error)

    async def _read_journal(self, request: ask.AnyRequest, client: str) -> tuple[reply.Answer, list[bytes]]:
        """Return the answer that a thread reads, when it is this client's turn and somebody still waits for it."""
        thread = self._listing if isinstance(request, ask.SamplesRequest) else self._looking
        task = asyncio.current_task()
        askers = self._askers[task] if task is not None else []
        while True:
            async with self._turns[thread, client]:
                if askers and all(asker.is_gone for asker in askers):
                    raise RequestError("busy", "the connection that asked has ended", "ask again")
                if not self._unread_by(askers):
                    run = asyncio.get_running_loop().run_in_executor
                    return await run(thread, self._handlers.answer, request, (), client)
            await self._room(askers)

    def _unread_by(self, askers: Sequence[Connection]) -> int:
        """Return the bytes that are too many for a further answer to any of these connections, else 0."""
        return min((self._unread.too_much(asker.handle) for asker in askers), default=0)

    async def _room(self, askers: Sequence[Connection]) -> None:
        """Wait until a client has read enough for a further answer. Raises RequestError once none reads anything."""
        while waiting := self._unread_by(askers):
            if not any(self._unread.is_reading(asker.handle) for asker in askers):
                raise _unread(waiting)
            await asyncio.sleep(SLOW_READER)

    def _why_not(self, request: str | None, error: Exception) -> list[bytes]:
        """Return the refusal for an error, and count it."""
        counts = self._handlers.metrics.counts
        if isinstance(error, RequestError):
            counts["refused"] += 1
            return _refusal(request, error.problem)
        if isinstance(error, WireError):
            counts["garbage"] += 1
            return _refusal(request, reply.ErrorBody("bad-request", str(error), "see docs/wire.md"))
        if isinstance(error, JournalError):
            return _refusal(request, reply.ErrorBody("journal", str(error)))
        log.error("request %s", request, exc_info=error)
        return _refusal(request, reply.ErrorBody("defect", f"a defect of pzctl, see the daemon's log: {error!r}"))


async def _bench(on: ServedAnalyzer, request: ask.BenchRequest, client: str) -> reply.BenchAnswer:
    """Pass a command on to the simulator's bench. Raises RequestError."""
    if on.bench is None:
        raise RequestError("no-bench", "the instrument of this daemon has no simulated bench")
    if taken := sorted({"host", "port", "timeout"} & request.command.keys()):
        raise RequestError("bench-failed", f"bench: no command has a field {taken[0]!r}")
    size = len(to_json(request.command))
    if size > LONGEST_COMMAND:
        raise RequestError("bench-failed", f"bench: a command of {size} bytes; at most {LONGEST_COMMAND} are allowed")
    host, _, port = on.bench.rpartition(":")
    with on.bench_step.command(request.command, client, busy=on.acquisition.is_busy) as answer:
        try:
            answer.update(await asyncio.to_thread(bench_command, host, int(port), **request.command))
        except PzctlError as error:
            raise RequestError("bench-failed", str(error)) from None
    return reply.BenchAnswer(id=request.id, answer=answer)


def _unread(waiting: int) -> RequestError:
    return RequestError(
        "too-much",
        f"{waiting >> 20} MB of earlier answers were not read yet",
        "read the earlier answers first, or ask one after the other",
    )


def _busy() -> RequestError:
    says = f"{AT_ONCE} requests of this client wait for their answers already"
    return RequestError("busy", says, "wait for one of the answers")


def _id_in_use(request: str) -> RequestError:
    return RequestError(
        "id-in-use",
        f"id {request!r} belongs to another request; only an identical request may be sent again with its id",
        "give every request a unique id, such as a UUID",
    )


class _Named(msgspec.Struct):
    id: str | None = None
    request: str | None = None


NAMES = tuple(str(kind.__struct_config__.tag) for kind in ask.AnyRequest.__args__)
"""The names of all requests."""

_request = msgspec.json.Decoder(ask.AnyRequest)
_named = msgspec.json.Decoder(_Named)


def _read(frames: Sequence[bytes]) -> ask.AnyRequest:
    """Return the request. Raises WireError if the frames are not a valid request, whatever they contain."""
    if not 1 <= len(frames) <= MOST_FRAMES:
        raise WireError(f"request: {len(frames)} frame(s); 1 to {MOST_FRAMES} are allowed")
    name = from_json(frames[0], _named).request
    if name not in NAMES:
        raise WireError(f"request: {name!r} is not known; known are {', '.join(NAMES)}")
    if name not in LARGE and len(frames[0]) > LARGEST_SMALL:
        raise WireError(f"request: {name} has {len(frames[0])} bytes; at most {LARGEST_SMALL} are allowed")
    request = from_stranger(frames[0], _request)
    if request.v != WIRE:
        raise WireError(
            f"request: it has wire version {request.v}; this daemon reads version {WIRE}; upgrade the older side"
        )
    check_names(request)
    return request


def _check_effects(asked: Sequence[str], known: frozenset[str]) -> None:
    """Raise RequestError if the catalogue lacks one of the effects."""
    unknown = sorted({*asked} - known)
    if unknown:
        raise RequestError("no-such-effect", f"effect {unknown[0]!r} is not known; {among(unknown[0], sorted(known))}")


def _property(frame: zmq.Frame, name: str) -> str | None:
    """Return a property of the connection that a frame came from: its descriptor, or its client's public key."""
    try:
        return str(frame.get(name))
    except zmq.ZMQError:
        return None


def _id_of(frames: Sequence[bytes]) -> str | None:
    """Return the id of an invalid request, if it has one."""
    try:
        return from_json(frames[0], _named).id if frames else None
    except WireError:
        return None


def _refusal(request: str | None, problem: reply.ErrorBody) -> list[bytes]:
    return [to_json(reply.Refusal(id=request, error=problem))]
