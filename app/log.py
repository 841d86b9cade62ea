"""What the program writes about itself: warnings as lines for people, or every event as a line of JSON for machines.

Secrets never get here: events name paths without their query, and nobody logs a header.
"""

from __future__ import annotations

import json
import logging
import time
from typing import Literal

Form = Literal["text", "json"]
_USUAL = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "color_message"}


class JsonLines(logging.Formatter):
    """One object a line: time (UTC), level, logger, event, and whatever else the event tells."""

    def format(self, record: logging.LogRecord) -> str:
        moment = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line = {"time": f"{moment}.{int(record.msecs):03d}Z", "level": record.levelname.lower(), "logger": record.name}
        line["event"] = record.getMessage()
        line |= {name: value for name, value in vars(record).items() if name not in _USUAL}
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def _our_failure(record: logging.LogRecord) -> bool:
    """A client that sends text which is no UTF-8 is closed, and uvicorn would print a traceback each time."""
    return not record.getMessage().startswith("Invalid UTF-8 sequence")


def configure(form: Form) -> None:
    """Write to standard error: warnings as text, or everything from information on as JSON."""
    handler = logging.StreamHandler()
    if form == "json":
        handler.setFormatter(JsonLines())
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    logging.getLogger("uvicorn.error").addFilter(_our_failure)
    logging.getLogger("app").setLevel(logging.INFO if form == "json" else logging.WARNING)
