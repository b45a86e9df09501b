"""`pzctl screenshot`: the instrument's screen, or the sweep it shows, as a file."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from ....drivers.base.analyzer import FileKind

KINDS: "dict[str, FileKind]" = {".tif": "screen", ".txt": "ascii", ".dat": "binary", ".s1p": "touchstone"}
"""The kind of file for each file name extension."""


def screenshot(
    file: Annotated[Path, typer.Argument(help=".tif for the screen; .txt, .dat or .s1p for the sweep shown.")],
    resource: Annotated[
        str | None, typer.Option(help="VISA resource of the 4294A; default: PZCTL_RESOURCE or config.toml.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fetch the instrument's screen, or the sweep it shows in one of its own file formats.

    Example: pzctl screenshot clips.tif --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    from ....drivers.base.analyzer import InstrumentError, MakesFiles
    from ...report.terminal import console
    from .instrument_access import own_analyzer

    kind = KINDS.get(file.suffix.lower())
    if kind is None:
        raise UsageError(f"{file}: the name ends with {file.suffix!r}; allowed are {', '.join(KINDS)}")
    with own_analyzer(resource) as analyzer:
        if not isinstance(analyzer, MakesFiles):
            raise UsageError(f"--resource {resource}: this analyzer cannot make files of its screen or sweep")
        data = analyzer.fetch(kind)
    try:
        file.write_bytes(data)
    except OSError as error:
        raise InstrumentError(f"{file}: cannot be written: {error.strerror}") from None
    if as_json:
        print(json.dumps({"file": str(file), "kind": kind, "bytes": len(data)}))
    else:
        console(stderr=True).print(f"{file}: {len(data)} bytes", highlight=False, soft_wrap=True)
