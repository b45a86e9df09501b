"""The page's server: its files, the daemon's events, and what the buttons do."""

import logging
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from ...drivers.recordings import csv_text
from ...models.base.errors import PzctlError
from ...models.build import Build
from ..client.protocol import DaemonError
from ..report.document.html_report import report_html
from ..report.document.pdf_report import report_pdf
from ..samples.sample_record import SampleRecord, sample_record
from ..samples.sample_selection import NoSamplesError, open_journal
from .event_stream import EventStream
from .manual_fit_pool import ManualFitPool, ManualFitRequest
from .page_client import PageClient
from .page_guard import Guard, shown_token, user_of
from .page_json import build_json, record_json
from .page_users import PageUser, PageUsers
from .request_body import BodyError, NoFields, read_body

log = logging.getLogger(__name__)

T = TypeVar("T", bound=msgspec.Struct)
A = TypeVar("A")

STATIC = Path(__file__).with_name("static")
MOST_SAMPLES = 20
"""Samples in the history."""


def page_app(build: Build, token: str | None = None, users: PageUsers | None = None) -> Starlette:
    """Return the page of a lab that builds `build`; with a token or users, only who shows one is let in."""

    def may_hear(scope: Scope) -> bool:
        return users is None or users.of_token(shown_token(Request(scope))) is not None

    hub, hands = EventStream(may_hear), ManualFitPool()
    desk = _PageRequestHandlers(build)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None]:
        hub.start()
        yield
        hub.stop()
        hands.close()

    async def index(_: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    routes = [
        Route("/", index),
        Route("/api/events", hub, methods=["GET"]),
        Route("/metrics", _answering(desk.metrics)),
        Route("/api/now", _answering(desk.now)),
        Route("/api/record/{name:path}", _answering(desk.record)),
        Route("/api/history", _answering(desk.history)),
        _command("/api/measure", _Measure, desk.measure),
        _command("/api/diagnose", _Diagnose, desk.diagnose),
        _command("/api/cancel", NoFields, desk.cancel),
        _command("/api/look", ManualFitRequest, lambda wish, _: JSONResponse(hands.look(wish))),
        _command("/api/fit", ManualFitRequest, lambda wish, _: JSONResponse(hands.fit(wish))),
        _command("/api/keep", ManualFitRequest, lambda wish, user: JSONResponse(hands.keep(_signed(wish, user)))),
        Route("/download/{measurement}/{segment}.csv", _answering(desk.download)),
        Route("/report/{name:path}", _answering(desk.report)),
        Route("/pdf/{name:path}", _answering(desk.pdf)),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Starlette(routes=routes, lifespan=lifespan, middleware=[Middleware(Guard, token=token, users=users)])


class _Measure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    step: str


class _Diagnose(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    measurement: str


def _signed(wish: ManualFitRequest, user: PageUser) -> ManualFitRequest:
    """Return a fit to be kept under the name that its user's token stands for, where there are users."""
    return msgspec.structs.replace(wish, by=user.name) if user.name else wish


def _answering(work: Callable[[dict[str, str], PageUser], Response]) -> Callable[[Request], Awaitable[Response]]:
    """Return an endpoint that looks something up, named in its address."""

    async def endpoint(request: Request) -> Response:
        return await _in_thread(work, request.path_params, user_of(request.scope))

    return endpoint


def _command(path: str, fields: type[T], work: Callable[[T, PageUser], Response]) -> Route:
    """Return the route of a command, whose body has these fields."""

    async def endpoint(request: Request) -> Response:
        try:
            body = await read_body(request, fields)
        except BodyError as error:
            return JSONResponse({"error": str(error)}, error.status)
        return await _in_thread(work, body, user_of(request.scope))

    return Route(path, endpoint, methods=["POST"])


async def _in_thread(work: Callable[[A, PageUser], Response], asked: A, user: PageUser) -> Response:
    """Answer from a thread; what is wrong is one sentence with status 404 or 409, a defect one with status 500."""
    try:
        return await run_in_threadpool(work, asked, user)
    except PzctlError as error:
        return JSONResponse({"error": str(error)}, 409 if isinstance(error, DaemonError) else 404)
    except Exception as error:
        log.exception("page")
        return JSONResponse({"error": f"a defect of pzctl, see the page's log: {error!r}"}, 500)


class _PageRequestHandlers:
    """What the page asks for; each method runs in a thread of its own and raises PzctlError."""

    def __init__(self, build: Build) -> None:
        self._build = build

    def now(self, _: dict[str, str], user: PageUser) -> Response:
        """Answer how things stand: daemon, instrument, build, latest measurement."""
        daemon: dict[str, Any] = {"there": False}
        try:
            with PageClient(user.name) as lab:
                hello, status = lab.hello(), lab.status()
            daemon = {
                "there": True,
                "version": hello.version,
                "instrument": hello.instrument.idn,
                "resource": hello.instrument.name,
                "simulated": hello.instrument.simulated,
                "measuring": status.measuring,
                "step": status.sample.step if status.sample else None,
                "fitters": [{"name": one.name, "state": one.state} for one in hello.fitters],
            }
        except DaemonError as error:
            daemon["says"] = str(error)
        return JSONResponse({"daemon": daemon, "build": build_json(self._build), "user": msgspec.to_builtins(user)})

    def metrics(self, _: dict[str, str], user: PageUser) -> Response:
        """Answer what a Prometheus server reads, whether a daemon is there or not."""
        try:
            from . import prometheus_metrics
        except ModuleNotFoundError as error:
            says = f"{error.name} is not installed; metrics need it: pip install 'pzctl[metrics]'"
            return PlainTextResponse(says, 501)
        try:
            with PageClient(user.name) as lab:
                text = prometheus_metrics.exposition(lab.metrics(), lab.status())
        except DaemonError:
            text = prometheus_metrics.exposition(None, None)
        return Response(text, media_type=prometheus_metrics.CONTENT_TYPE)

    def record(self, words: dict[str, str], user: PageUser) -> Response:
        """Answer what is known of a sample, or of one measurement."""
        record = _record(words["name"])
        steps = [record_json(one) for one in record.steps]
        return JSONResponse(
            {
                "sample": record.name,
                "build": build_json(record.build),
                "steps": steps,
                "withdrawn": list(record.withdrawn),
            }
        )

    def history(self, _: dict[str, str], user: PageUser) -> Response:
        """Answer the constants of the newest samples, step by step."""
        try:
            journal = open_journal()
        except NoSamplesError:
            return JSONResponse({"samples": []})
        try:
            names = list(dict.fromkeys(one.sample.name for one in journal.measurements("state = 'measured'")))
            records = [sample_record(journal, name) for name in names[-MOST_SAMPLES:]]
        finally:
            journal.close()
        return JSONResponse({"samples": [_constants(record) for record in records]})

    def measure(self, asked: _Measure, user: PageUser) -> Response:
        """Begin to measure a step; the simulated bench glues first, a person has done it."""
        with PageClient(user.name) as lab:
            if lab.hello().bench is not None:
                lab.bench({"command": "step", "name": asked.step})
            return JSONResponse({"measurement": lab.begin(self._build, asked.step)})

    def diagnose(self, asked: _Diagnose, user: PageUser) -> Response:
        """Have a measurement diagnosed; what is found comes as an event."""
        with PageClient(user.name) as lab:
            lab.diagnose(asked.measurement)
        return JSONResponse({})

    def cancel(self, _: NoFields, user: PageUser) -> Response:
        """Stop what is measured."""
        with PageClient(user.name) as lab:
            lab.cancel()
        return JSONResponse({})

    def download(self, words: dict[str, str], user: PageUser) -> Response:
        """Answer one sweep of a measurement as the project's CSV."""
        (one,) = _record(words["measurement"]).steps
        numbers = {str(k): k for k in range(1, len(one.sweeps) + 1)}
        k = numbers.get(words["segment"])
        if k is None:
            return JSONResponse({"error": f"there is no such sweep; they are 1 to {len(one.sweeps)}"}, 404)
        name = f"{one.measurement.sample.step}-{k}.csv"
        headers = {"Content-Disposition": f'attachment; filename="{name.encode("ascii", "replace").decode()}"'}
        return PlainTextResponse(csv_text(one.sweeps[k - 1]), headers=headers, media_type="text/csv")

    def report(self, words: dict[str, str], user: PageUser) -> Response:
        """Answer the report of a sample; its style stands inside, so the page's own rule is loosened for it."""
        policy = "default-src 'none'; style-src 'unsafe-inline'"
        return HTMLResponse(report_html(_record(words["name"])), headers={"Content-Security-Policy": policy})

    def pdf(self, words: dict[str, str], user: PageUser) -> Response:
        """Answer the report of a sample as PDF."""
        return Response(report_pdf(report_html(_record(words["name"]))), media_type="application/pdf")


def _record(asked: str) -> SampleRecord:
    journal = open_journal()
    try:
        return sample_record(journal, asked)
    finally:
        journal.close()


def _constants(record: SampleRecord) -> dict[str, Any]:
    return {
        "name": record.name,
        "steps": [
            {
                "step": one.measurement.sample.step,
                "time": one.measurement.time,
                "constants": {
                    name: {"re": constant.re, "u": constant.u_re, "unit": constant.unit}
                    for name, constant in one.fits[0].constants.items()
                    if constant.free
                }
                if one.fits
                else {},
            }
            for one in record.steps
        ],
    }
