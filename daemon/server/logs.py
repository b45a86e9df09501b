"""The daemon's log: lines of text for people, or one JSON object per line for programs."""

import json
import logging
import os
import threading
from collections.abc import Callable
from contextlib import nullcontext
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Literal

from ...models.base.names import shown

LARGEST_LOG = 10 << 20
"""Greatest size in bytes of a background daemon's log file; then a new file is started."""

LOGS_KEPT = 3
"""Number of full log files to keep, `daemon.log.1` and so on."""

MINUTE = 60.0

REPEATED = 5
"""Number of warnings of one kind per minute that are logged; further ones are only counted."""


def _later(seconds: float, action: Callable[[], None]) -> None:
    """Call a function later, unless the process has ended by then."""
    timer = threading.Timer(seconds, action)
    timer.daemon = True
    timer.start()


class TextLines(logging.Formatter):
    """`time level message` on one line, whatever the message holds; a traceback follows on separate lines."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        """Return the line with characters that cannot be printed escaped."""
        return shown(super().formatMessage(record))


class JsonLines(logging.Formatter):
    """`{"time", "level", "logger", "message"}`, and `trace` if there is an exception."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the record as one line."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            line["trace"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=True)


class RotatingLog(RotatingFileHandler):
    """A rotating log file that standard output and standard error are redirected to as well."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, maxBytes=LARGEST_LOG, backupCount=LOGS_KEPT, encoding="utf-8")
        if self.stream is not None:
            self._point_at(self.stream.fileno())

    def doRollover(self) -> None:
        """Start a new file."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        self._point_at(nowhere)  # Windows cannot rename an open file
        os.close(nowhere)
        super().doRollover()
        if self.stream is not None:
            self._point_at(self.stream.fileno())

    @staticmethod
    def _point_at(handle: int) -> None:
        for stream in (1, 2):
            os.dup2(handle, stream)


class RepeatLimit(logging.Handler):
    """Passes on a limited number of warnings of one kind per minute, then logs how many more there were."""

    def __init__(self, to: logging.Handler, later: Callable[[float, Callable[[], None]], None] = _later) -> None:
        super().__init__()
        self._to = to
        self._later = later
        self._counts: dict[tuple[str, str], int] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a record on, or count it."""
        if record.levelno < logging.WARNING:
            self._to.handle(record)
            return
        kind = (record.name, str(record.msg))
        if kind not in self._counts:
            self._counts[kind] = 0
            self._later(MINUTE, lambda: self._sum_up(record))
        self._counts[kind] += 1
        if self._counts[kind] <= REPEATED:
            self._to.handle(record)

    def _sum_up(self, first: logging.LogRecord) -> None:
        """Log how many warnings of a kind were left out."""
        with self.lock or nullcontext():
            more = self._counts.pop((first.name, str(first.msg)), 0) - REPEATED
        if more > 0:
            says = f"... and {more} more in the last minute like: {first.getMessage()}"
            self._to.handle(logging.LogRecord(first.name, first.levelno, first.pathname, first.lineno, says, (), None))


def begin_log(form: Literal["text", "json"] = "text", file: Path | None = None) -> None:
    """Start logging from level INFO to standard error, or to a rotating file that replaces it."""
    handler = logging.StreamHandler() if file is None else RotatingLog(file)
    handler.setFormatter(JsonLines() if form == "json" else TextLines("%(asctime)s %(levelname)s %(message)s"))
    logging.basicConfig(level=logging.INFO, handlers=[RepeatLimit(handler)])
