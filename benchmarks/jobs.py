"""The jobs that are measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"


def v_document(**changes: dict[str, Any]) -> dict[str, Any]:
    """Return the V job with other values in some of its sections."""
    text = (WORKPIECES / "v_shape" / "job.yaml").read_text(encoding="utf-8")
    document = yaml.safe_load(text)
    for section, values in changes.items():
        document[section] = {**document[section], **values}
    return dict(document)
