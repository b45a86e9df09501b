"""The page's HTTP interface as an OpenAPI 3.1 document, generated from its routes."""

import inspect
import re
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

import msgspec
from starlette.routing import BaseRoute, Route

from .request_body import FORM

_PARAMETER = re.compile(r"{(\w+)(?::path)?}")
_KINDS = {"/report": "text/html", "/pdf": "application/pdf", "/download": "text/csv", "/metrics": "text/plain"}
"""Media types of the answers that are not JSON, by the beginning of the path."""
_ERROR = {
    "type": "object",
    "properties": {"error": {"type": "string", "description": "One sentence: what, where, found, allowed."}},
    "required": ["error"],
}
_REFUSALS = {
    "400": "The body is not a JSON object of these fields.",
    "401": "No valid token.",
    "403": "The token has the right to read only, or a command has no token in its header.",
    "404": "There is no such sample, measurement or sweep.",
    "409": "The daemon refuses, or none runs.",
}


def openapi(routes: Sequence[BaseRoute], bodies: Mapping[str, type[msgspec.Struct]]) -> dict[str, Any]:
    """Return the document of all routes that programs can use; `bodies`: the fields of each command, by path."""
    made: Any = msgspec.json.schema_components(bodies.values(), ref_template="#/components/schemas/{name}")
    refs: dict[str, dict[str, Any]] = dict(zip(bodies, made[0], strict=True))
    paths: dict[str, Any] = {}
    for route in routes:
        if isinstance(route, Route) and route.path != "/":
            method = "post" if "POST" in (route.methods or ()) else "get"
            paths[route.path.replace(":path}", "}")] = {method: _operation(route, refs.get(route.path))}
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "pzctl",
            "version": version("pzctl"),
            "description": "Measure, read sweeps and constants, diagnose and compare over HTTP. SI units; frequencies "
            "in Hz, impedances in ohm, time convention exp(+jwt).",
        },
        "security": [{"token": []}],
        "paths": paths,
        "components": {
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
            "schemas": {**made[1], "Error": _ERROR},
        },
    }


def _operation(route: Route, body: Mapping[str, Any] | None) -> dict[str, Any]:
    summary, _, more = (inspect.getdoc(route.endpoint) or "").partition("\n\n")
    kind = next((kind for start, kind in _KINDS.items() if route.path.startswith(start)), "application/json")
    if route.path == "/api/events":
        kind = "text/event-stream"
    operation: dict[str, Any] = {
        "summary": summary,
        "parameters": [
            {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
            for name in _PARAMETER.findall(route.path)
        ],
        "responses": {"200": {"description": "Done.", "content": {kind: {}}}}
        | {
            status: {
                "description": says,
                "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Error"}}},
            }
            for status, says in _REFUSALS.items()
            if body is not None or status not in ("400", "403")
        },
    }
    if more:
        operation["description"] = more
    if body is not None:
        operation["requestBody"] = {
            "required": True,
            "content": {kind: {"schema": body} for kind in ("application/json", FORM)},
        }
    return operation
