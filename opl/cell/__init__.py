"""The robot and what stands around it."""

from pathlib import Path

from opl.files.kernel_cache import settle_kernel_cache

settle_kernel_cache(Path(__file__).parents[1])
