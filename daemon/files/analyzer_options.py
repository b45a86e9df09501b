"""Several analyzers under one daemon: the tables `[analyzers.NAME]` of the config file."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, cast

from ...models.base.names import check_name

ONLY = "analyzer"
"""Name of the analyzer of a daemon that has one."""


@dataclass(frozen=True)
class AnalyzerOptions:
    """One analyzer and the limits of its bench."""

    resource: str | None = None
    """VISA resource of the analyzer; None starts a simulated 4294A."""
    max_bias_V: float | None = None
    max_oscillator_V: float | None = None
    """Highest bias, and highest test signal (rms), that its bench allows in addition to the analyzer's limits."""
    bench: str | None = None
    """`host:port` of the simulator's bench, if the resource is a simulated instrument."""


def read_analyzers(tables: Any) -> dict[str, AnalyzerOptions]:
    """Return the analyzers by name, in the order of the file. Raises ValueError, TypeError, NameFault."""
    if not isinstance(tables, Mapping) or not tables:
        raise ValueError
    named = cast("Mapping[str, Any]", tables)
    return {check_name(name, "name"): _analyzer(table) for name, table in named.items()}


def _analyzer(table: Any) -> AnalyzerOptions:
    if not isinstance(table, Mapping) or not {*table} <= {field.name for field in fields(AnalyzerOptions)}:  # pyright: ignore[reportUnknownArgumentType]
        raise ValueError
    values = cast("Mapping[str, Any]", table)
    for key, value in values.items():
        if key.startswith("max_"):
            if isinstance(value, bool) or not 0 <= float(value) < float("inf"):
                raise ValueError
        elif not isinstance(value, str) or not value.isprintable() or not value:
            raise ValueError
    return AnalyzerOptions(**values)
