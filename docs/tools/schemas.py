"""The wire's headers as JSON Schema, generated from the types that read and write them.

python docs/tools/schemas.py docs/schema
"""

import json
import sys
from pathlib import Path
from typing import Any

import msgspec

from pzctl.daemon.wire import events as wire
from pzctl.daemon.wire import replies as reply
from pzctl.daemon.wire import requests as ask

STAMP = ("v", "run", "seq", "id", "time", "columns")
"""Fields of every event; the journal sets them, so the types have defaults for them."""


def schemas() -> dict[str, dict[str, Any]]:
    """Return the schema of every header: `event-sweep`, `request-measure`, `answer-hello` ..."""
    events = {f"event-{_tag(kind)}": _schema(kind, STAMP) for kind in wire.AnyEvent.__args__}
    requests = {f"request-{_tag(kind)}": _schema(kind) for kind in ask.AnyRequest.__args__}
    answers = {f"answer-{name}": _schema(kind, ("id", "ok")) for name, kind in ANSWERS.items()}
    return {
        name: {"$id": f"pzctl/{wire.WIRE}/{name}", **schema} for name, schema in (events | requests | answers).items()
    }


ANSWERS: dict[str, type[reply.Answer]] = {
    "done": reply.Answer,
    "refused": reply.Refusal,
    "hello": reply.HelloAnswer,
    "status": reply.StatusAnswer,
    "metrics": reply.MetricsAnswer,
    "settings": reply.SettingsAnswer,
    "measure": reply.MeasureAnswer,
    "errand": reply.JobAnswer,
    "lease": reply.LeaseAnswer,
    "events": reply.EventsAnswer,
    "samples": reply.SamplesAnswer,
    "measurements": reply.MeasurementsAnswer,
    "bench": reply.BenchAnswer,
}
"""`done` answers cancel, release, submit, shutdown; `events` replay, sweeps, fits; `errand` fit and diagnose."""


def text(schema: dict[str, Any]) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _tag(kind: type[msgspec.Struct]) -> str:
    return str(kind.__struct_config__.tag)


def _schema(kind: type[msgspec.Struct], always: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return one schema; `always` are fields that are always present although their type has a default."""
    (reference,), parts = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    name = str(reference["$ref"]).rpartition("/")[2]
    whole = parts.pop(name)
    whole["required"] = [*whole.get("required", []), *(a for a in always if a not in whole.get("required", []))]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **whole, "$defs": parts}


def main() -> None:
    """Write all schemas into the given folder."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, schema in schemas().items():
        (folder / f"{name}.json").write_text(text(schema), encoding="utf-8")


if __name__ == "__main__":
    main()
