"""The daemon's log: lines for people, or one JSON object a line for programs."""

import json
import logging
from datetime import UTC, datetime
from typing import Literal

from ...models.base.names import shown


class TextLines(logging.Formatter):
    """`time level message`, on one line whatever the message is; a traceback follows on lines of its own."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        """Return the line, what cannot be printed escaped."""
        return shown(super().formatMessage(record))


class JsonLines(logging.Formatter):
    """`{"time", "level", "logger", "message"}`, and `trace` where there is an exception."""

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


def begin_log(form: Literal["text", "json"] = "text") -> None:
    """Log to standard error from now on, from level INFO."""
    handler = logging.StreamHandler()
    text = TextLines("%(asctime)s %(levelname)s %(message)s")
    handler.setFormatter(JsonLines() if form == "json" else text)
    logging.basicConfig(level=logging.INFO, handlers=[handler])
