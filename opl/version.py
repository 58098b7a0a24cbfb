"""The version of opl, which is part of what a proof was made with."""

from __future__ import annotations

VERSION = "0.1.0"
