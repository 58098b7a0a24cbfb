"""Compiled kernels are kept where somebody can write."""

import os
from pathlib import Path

import pytest

from opl.files import kernel_cache
from opl.files.kernel_cache import settle_kernel_cache


@pytest.fixture(autouse=True)
def apart(monkeypatch, tmp_path):
    """An environment of its own, and what is registered for the end done at once."""
    done = []
    monkeypatch.setattr(kernel_cache.atexit, "register", lambda *one, **named: done.append(one))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "MPLCONFIGDIR"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    yield
    for remove, *arguments in done:
        remove(*arguments)


def blocked(path):
    """Return a place where no folder can be made, for root neither: below a file."""
    path.write_text("")
    return path / "below"


def test_beside_the_code_or_in_the_home_is_no_matter(tmp_path, caplog, monkeypatch):
    settle_kernel_cache(tmp_path)
    assert Path(os.environ["NUMBA_CACHE_DIR"]).parent == tmp_path / "__pycache__"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    settle_kernel_cache(blocked(tmp_path / "installed"))
    assert Path(os.environ["NUMBA_CACHE_DIR"]).parent == tmp_path / "home" / ".cache" / "opl"
    assert caplog.text == ""


def test_kernels_of_other_code_are_not_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
    package = tmp_path / "package"
    package.mkdir()

    def place(kernel, other):
        (package / "kernel.py").write_text(f"from opl.files.kernels import kernel\n{kernel}")
        (package / "other.py").write_text(other)
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
        kernel_cache._mark.cache_clear()  # as in another process
        settle_kernel_cache(package)
        settle_kernel_cache(package)  # as the next room does
        return Path(os.environ["NUMBA_CACHE_DIR"])

    first = place("a = 1", "b = 1")
    assert first.parent == tmp_path / "given"
    assert place("a = 1", "b = 2") == first
    assert place("a = 2", "b = 2") != first
    # nor those that were compiled in another way
    (package / "files").mkdir()
    (package / "files" / "kernels.py").write_text("cache = True")
    assert place("a = 1", "b = 2") != first


@pytest.mark.parametrize("given", [False, True])
def test_nowhere_to_write_is_said_once_with_the_variable(tmp_path, monkeypatch, caplog, given):
    monkeypatch.setenv("HOME", str(blocked(tmp_path / "file")))
    if given:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "x"))
    place = blocked(tmp_path / "installed") if not given else tmp_path
    settle_kernel_cache(place)
    settle_kernel_cache(place)
    (record,) = caplog.records
    assert "are compiled anew at every start" in record.getMessage()
    assert "set NUMBA_CACHE_DIR to a folder that can" in record.getMessage()
    assert Path(os.environ["NUMBA_CACHE_DIR"]).is_dir()
    assert os.environ["MPLCONFIGDIR"] == os.environ["NUMBA_CACHE_DIR"]
