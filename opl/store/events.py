"""What happens to jobs, one line of JSON each, for whoever listens to the logger ``opl.jobs``."""

from __future__ import annotations

import json
import logging
from datetime import datetime, timezone

LOGGER = logging.getLogger("opl.jobs")
LOGGER.addHandler(logging.NullHandler())
LOGGER.propagate = False
LOGGER.setLevel(logging.INFO)


def tell(event: str, **facts: object) -> None:
    """Tell an event with its facts; the job it is about is called ``job``."""
    now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
    LOGGER.info(json.dumps({"time": now, "event": event, **facts}))
