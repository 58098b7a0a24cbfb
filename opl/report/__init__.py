"""Pictures for people."""

from pathlib import Path

from opl.files.kernel_cache import settle_kernel_cache

settle_kernel_cache(Path(__file__).parents[1])  # matplotlib writes there where it has no other
