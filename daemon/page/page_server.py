"""The page's web application: its files, the daemon's events, and the commands of its buttons."""

import logging
import shutil
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager
from email.message import Message
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import msgspec
from anyio import CapacityLimiter, to_thread
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from ...drivers.recordings import csv_text
from ...fitters.population.conformity import judged
from ...models.base.errors import PzctlError
from ...models.base.names import LONGEST_NAME
from ...models.build import Build, Quantity
from ...models.metadata import MetadataError, check_metadata
from ..client.gluing import glue
from ..client.protocol import DaemonError
from ..files.config import settings
from ..files.paths import home
from ..report.document.html_report import report_html
from ..report.pictures.svg_pictures import svg_of
from ..report.tables.verdict_table import verdict_json
from ..samples.measurement_notes import HEAVIEST_GRAMS, noted_build
from ..samples.process_chart import process_chart
from ..samples.sample_record import SampleRecord, sample_record
from ..samples.sample_selection import NoSamplesError, open_journal
from .event_stream import EventStream
from .manual_fit_pool import ManualFitPool, ManualFitRequest
from .openapi import openapi
from .page_client import PageClient
from .page_comparison import ComparisonRequest, allowed_sweeps, compared
from .page_guard import Guard, shown_token, user_of
from .page_json import build_json, record_json
from .page_users import PageUser, PageUsers
from .request_body import BodyError, NoFields, read_body
from .worker_process import WorkerProcess

log = logging.getLogger(__name__)

T = TypeVar("T", bound=msgspec.Struct)
A = TypeVar("A")

STATIC = Path(__file__).with_name("static")
SLOW = ("/api/diagnose", "/api/look", "/api/fit", "/api/keep", "/api/compare")
"""Commands that wait for computations, minutes long; the others, above all `/api/cancel`, must not wait for them."""
SLOW_AT_ONCE = 20
"""Greatest number of each of these that wait in a thread; further ones wait for a thread."""
MOST_SAMPLES = 20
"""Greatest number of samples in the history."""


def page_app(build: Build, token: str | None = None, users: PageUsers | None = None) -> Starlette:
    """Return the web application for `build`; with a token or users, every request needs a valid token."""

    def may_hear(scope: Scope) -> bool:
        return users is None or users.of_token(shown_token(Request(scope))) is not None

    events, manual_fits, worker = EventStream(may_hear), ManualFitPool(), WorkerProcess()
    handlers = _PageRequestHandlers(build)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None]:
        events.start()
        yield
        events.stop()
        manual_fits.close()
        worker.close()

    def look(request: ManualFitRequest, _: PageUser) -> Response:
        """Return the curves and the misfit of a fit by hand."""
        return JSONResponse(manual_fits.look(request))

    def fit(request: ManualFitRequest, _: PageUser) -> Response:
        """Fit by hand: only what the request frees."""
        return JSONResponse(manual_fits.fit(request))

    def keep(request: ManualFitRequest, user: PageUser) -> Response:
        """Keep a fit by hand in the journal."""
        return JSONResponse(manual_fits.keep(_signed(request, user)))

    def compare(request: ComparisonRequest, _: PageUser) -> Response:
        """Say what changed between two sweeps of the journal."""
        return JSONResponse(compared(worker, request))

    def document(_: dict[str, str], __: PageUser) -> Response:
        """Return this document."""
        return JSONResponse(openapi(routes, bodies))

    async def index(_: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    commands: dict[str, tuple[type[msgspec.Struct], Callable[[Any, PageUser], Response]]] = {
        "/api/measure": (MeasureCommand, handlers.measure),
        "/api/diagnose": (DiagnoseCommand, handlers.diagnose),
        "/api/cancel": (NoFields, handlers.cancel),
        "/api/look": (ManualFitRequest, look),
        "/api/fit": (ManualFitRequest, fit),
        "/api/keep": (ManualFitRequest, keep),
        "/api/compare": (ComparisonRequest, compare),
    }
    bodies = {path: fields for path, (fields, _) in commands.items()}
    routes = [
        Route("/", index),
        Route("/api/openapi.json", _answering(document)),
        Route("/api/events", events, methods=["GET"]),
        Route("/metrics", _answering(handlers.metrics)),
        Route("/api/now", _answering(handlers.now)),
        Route("/api/record/{name:path}", _answering(handlers.record)),
        Route("/api/history", _answering(handlers.history)),
        *(_command(path, fields, work) for path, (fields, work) in commands.items()),
        Route("/download/{measurement}/{segment}.csv", _answering(handlers.download)),
        Route("/report/{name:path}", _answering(handlers.report)),
        Route("/chart/{constant}", _answering(handlers.chart)),
        Route("/pdf/{name:path}", _answering(handlers.pdf)),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Starlette(
        routes=routes,
        lifespan=lifespan,
        middleware=[Middleware(Guard, token=token, users=users)],
        exception_handlers={HTTPException: _refused, Exception: _failed},
    )


def _refused(request: Request, error: Exception) -> Response:
    """Answer a request for a path that does not exist, or by another method than that of the path."""
    refusal = cast(HTTPException, error)
    headers = refusal.headers or {}
    match refusal.status_code:
        case 404:
            says = "nothing is at this path; /api/openapi.json lists all paths"
        case 405:
            says = f"{request.method} is not allowed at this path; allowed is {headers.get('Allow', 'GET')}"
        case _:
            says = refusal.detail
    return JSONResponse({"error": says}, refusal.status_code, headers)


def _failed(_: Request, error: Exception) -> Response:
    """Answer where an endpoint failed outside its thread; the server logs the traceback."""
    return JSONResponse({"error": f"a defect of pzctl, see the page's log: {error!r}"}, 500)


Name = Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_NAME)]


class BalanceMass(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mass from the balance."""

    value: Annotated[float, msgspec.Meta(gt=0, lt=HEAVIEST_GRAMS)]
    """Grams."""
    u: Annotated[float, msgspec.Meta(gt=0)]
    """Standard uncertainty of the balance, grams; less than `value`."""

    def __post_init__(self) -> None:
        """Refuse a mass that the balance does not know, as the command line does."""
        if self.u >= self.value:
            raise ValueError(f"the uncertainty is {self.u:g} g and the mass {self.value:g} g; it has to be less")


class MeasureCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A measurement of one step."""

    step: Name
    metadata: dict[str, str | float] = {}
    """What to note with it: `operator`, `temperature_C`, `batch`, `barcode`, and any other key."""
    mass_g: BalanceMass | None = None
    """Mass of all layers of this step; a datum of the density."""
    analyzer: Name | None = None
    """Name of the analyzer, if the daemon has several; default: the first."""


class DiagnoseCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The diagnosis of a measurement."""

    measurement: str


def _signed(request: ManualFitRequest, user: PageUser) -> ManualFitRequest:
    """Return the request with the name of the token's user in place of the typed one, if there is a file of users."""
    return msgspec.structs.replace(request, by=user.name) if user.name else request


def _answering(work: Callable[[dict[str, str], PageUser], Response]) -> Callable[[Request], Awaitable[Response]]:
    """Return an endpoint that passes the parameters of its path to `work`."""

    async def endpoint(request: Request) -> Response:
        return await _in_thread(work, request.path_params, user_of(request.scope))

    endpoint.__doc__ = work.__doc__
    return endpoint


def _command(path: str, fields: type[T], work: Callable[[T, PageUser], Response]) -> Route:
    """Return the route of a command whose body has these fields; each of the `SLOW` ones has threads of its own."""
    threads = CapacityLimiter(SLOW_AT_ONCE) if path in SLOW else None

    async def endpoint(request: Request) -> Response:
        try:
            body = await read_body(request, fields)
        except BodyError as error:
            return JSONResponse({"error": str(error)}, error.status)
        return await _in_thread(work, body, user_of(request.scope), threads)

    endpoint.__doc__ = work.__doc__
    return Route(path, endpoint, methods=["POST"])


def _sentence(error: DaemonError) -> str:
    """Return a refusal of the daemon as the page says it: what is the matter, and what to do."""
    match error.code:
        case "busy":
            return "The instrument measures, or a layer is being glued. Wait until it is done, or stop it."
        case "bench-failed":
            return f"The simulated bench cannot do this: {error}. Glue stays: measure the steps in their order."
        case _:
            return str(error)


def _attachment(name: str) -> dict[str, str]:
    """Return the header of a download under this name, whatever characters it has (RFC 6266)."""
    message = Message()
    message.add_header("Content-Disposition", "attachment", filename=("utf-8", "", name))
    return {"Content-Disposition": message["Content-Disposition"]}


async def _in_thread(
    work: Callable[[A, PageUser], Response], argument: A, user: PageUser, threads: CapacityLimiter | None = None
) -> Response:
    """Answer from a thread; an error becomes one sentence with status 400, 404 or 409, a defect one with status 500."""
    try:
        return await to_thread.run_sync(work, argument, user, limiter=threads)
    except DaemonError as error:
        return JSONResponse({"error": _sentence(error)}, 409)
    except MetadataError as error:
        return JSONResponse({"error": f"request: {error}"}, 400)
    except PzctlError as error:
        return JSONResponse({"error": str(error)}, 404)
    except Exception as error:
        log.exception("page")
        return JSONResponse({"error": f"a defect of pzctl, see the page's log: {error!r}"}, 500)


class _PageRequestHandlers:
    """The handlers of the page's requests; each runs in a thread of its own and raises PzctlError."""

    def __init__(self, build: Build) -> None:
        self._build = build

    def now(self, _: dict[str, str], user: PageUser) -> Response:
        """Return the state of daemon and instrument, the build, and the user."""
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
                "fitters": [{"name": fitter.name, "state": fitter.state} for fitter in hello.fitters],
            }
        except DaemonError as error:
            daemon["says"] = str(error)
        return JSONResponse({"daemon": daemon, "build": build_json(self._build), "user": msgspec.to_builtins(user)})

    def metrics(self, _: dict[str, str], user: PageUser) -> Response:
        """Return the metrics for a Prometheus server, whether a daemon runs or not."""
        try:
            from . import prometheus_metrics
        except ModuleNotFoundError as error:
            says = f"{error.name} is not installed; metrics need it: pip install {error.name}"
            return JSONResponse({"error": says}, 501)
        free = shutil.disk_usage(home()).free
        try:
            with PageClient(user.name) as lab:
                text = prometheus_metrics.exposition(lab.metrics(), lab.status(), free)
        except DaemonError:
            text = prometheus_metrics.exposition(None, None, free)
        return Response(text, media_type=prometheus_metrics.CONTENT_TYPE)

    def record(self, words: dict[str, str], user: PageUser) -> Response:
        """Return the record of a sample, or of one measurement."""
        record = _record(words["name"])
        steps = [record_json(step, record.build) for step in record.steps]
        return JSONResponse(
            {
                "sample": record.name,
                "build": build_json(record.build),
                "steps": steps,
                "withdrawn": list(record.withdrawn),
            }
        )

    def history(self, _: dict[str, str], user: PageUser) -> Response:
        """Return the constants of the newest samples, step by step."""
        try:
            journal = open_journal()
        except NoSamplesError:
            return JSONResponse({"samples": []})
        try:
            names = list(
                dict.fromkeys(measurement.sample.name for measurement in journal.measurements("state = 'measured'"))
            )
            records = [sample_record(journal, name) for name in names[-MOST_SAMPLES:]]
        finally:
            journal.close()
        return JSONResponse({"samples": [_constants(record) for record in records]})

    def measure(self, command: MeasureCommand, user: PageUser) -> Response:
        """Start measuring a step; a simulated bench first glues the layer."""
        check_metadata(command.metadata, "metadata")
        mass = command.mass_g and Quantity(command.mass_g.value / 1e3, u=command.mass_g.u / 1e3, source="balance")
        signed = {"operator": user.name} if user.name else {}
        notes = {**signed, **command.metadata}
        with PageClient(user.name) as lab:
            owned = lab.hello().analyzers
            on = [one for one in owned if command.analyzer in (None, one.name)][:1]
            build = self._build
            if command.step in [step.name for step in build.steps]:  # the daemon refuses others
                if on and on[0].bench is not None:
                    glue(lab, command.step, command.analyzer)
                build = noted_build(build, command.step, notes, mass, settings({}).get("readers", ()))
            return JSONResponse({"measurement": lab.begin(build, command.step, analyzer=command.analyzer)})

    def diagnose(self, command: DiagnoseCommand, user: PageUser) -> Response:
        """Request the diagnosis of a measurement; the result arrives as an event."""
        with PageClient(user.name) as lab:
            lab.diagnose(command.measurement)
        return JSONResponse({})

    def cancel(self, _: NoFields, user: PageUser) -> Response:
        """Cancel the running measurement."""
        with PageClient(user.name) as lab:
            lab.cancel()
        return JSONResponse({})

    def download(self, words: dict[str, str], user: PageUser) -> Response:
        """Return one sweep of a measurement as the project's CSV."""
        record = _record(words["measurement"])
        step, *others = record.steps
        if others:
            ids = ", ".join(f"{one.measurement.id} ({one.measurement.sample.step})" for one in record.steps)
            says = f"{record.name} has {len(record.steps)} measurements; ask for the sweeps of one: {ids}"
            return JSONResponse({"error": says}, 404)
        numbers = {str(k): k for k in range(1, len(step.sweeps) + 1)}
        k = numbers.get(words["segment"])
        if k is None:
            return JSONResponse({"error": f"no such sweep; {allowed_sweeps(len(step.sweeps))}"}, 404)
        headers = _attachment(f"{step.measurement.sample.step}-{k}.csv")
        return PlainTextResponse(csv_text(step.sweeps[k - 1]), headers=headers, media_type="text/csv")

    def report(self, words: dict[str, str], user: PageUser) -> Response:
        """Return the report of a sample, with a content policy that allows its inline style."""
        policy = "default-src 'none'; style-src 'unsafe-inline'"
        return HTMLResponse(report_html(_record(words["name"])), headers={"Content-Security-Policy": policy})

    def chart(self, words: dict[str, str], user: PageUser) -> Response:
        """Return the control charts of a constant over the samples as SVG, or as JSON if the name ends with .json."""
        from ..report.pictures.control_chart_picture import control_chart_figure

        journal = open_journal()
        try:
            chart = process_chart(journal, words["constant"].removesuffix(".json"))
        finally:
            journal.close()
        if words["constant"].endswith(".json"):
            return JSONResponse(chart.json())
        svg = svg_of(control_chart_figure(chart.chart, chart.title, chart.unit, chart.limit), "control-chart")
        policy = "default-src 'none'; style-src 'unsafe-inline'"
        return Response(svg, media_type="image/svg+xml", headers={"Content-Security-Policy": policy})

    def pdf(self, words: dict[str, str], user: PageUser) -> Response:
        """Return the report of a sample as PDF."""
        from ..report.document.pdf_report import report_pdf  # a third of a second, which the page's start need not take

        return Response(report_pdf(report_html(_record(words["name"]))), media_type="application/pdf")


def _record(name: str) -> SampleRecord:
    journal = open_journal()
    try:
        return sample_record(journal, name)
    finally:
        journal.close()


def _constants(record: SampleRecord) -> dict[str, Any]:
    return {
        "name": record.name,
        "steps": [
            {
                "step": step.measurement.sample.step,
                "time": step.measurement.time,
                "constants": {
                    name: {"re": constant.re, "u": constant.u_re, "unit": constant.unit}
                    for name, constant in step.fits[0].constants.items()
                    if constant.free
                }
                if step.fits
                else {},
                "verdict": verdict_json(judged(step.fits[0], record.build)) if step.fits else None,
            }
            for step in record.steps
        ],
    }
