"""Golden files, compared byte for byte; processes that start warm; workers that share the cores."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

import opl  # noqa: F401  before numpy, which it lets round alike on every processor

# a first call may compile a kernel, and no test asserts what the clock says
settings.register_profile("opl", deadline=None)
settings.load_profile("opl")

GOLDEN = Path(__file__).parent / "golden"

# the workers of a run share the cores; settled before numba is loaded
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")


def pytest_configure(config):
    if getattr(config.option, "numprocesses", 0) and not hasattr(config, "workerinput"):
        from tests.support.all_kernels import compile_all

        compile_all()


def pytest_addoption(parser):
    parser.addoption(
        "--rewrite-golden",
        action="store_true",
        help="write tests/golden anew; look at every difference before keeping it",
    )


@pytest.fixture
def assert_golden(request):
    """Compare a text with tests/golden/<name>."""

    def compare(name, text):
        path = GOLDEN / name
        if request.config.getoption("--rewrite-golden"):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode("ascii"))
        assert path.is_file(), f"no golden file {name}; make it with pytest --rewrite-golden"
        # decoded, so that pytest can show where they differ; line ends stay as they are
        assert text == path.read_bytes().decode("ascii")

    return compare


@pytest.fixture
def warm_processes(monkeypatch):
    """Let strangers' files be read in processes that start warm."""
    from tests.support.warm_processes import STAND_IN

    monkeypatch.setattr("opl.files.apart.subprocess", STAND_IN)


@pytest.fixture(scope="module")
def no_pictures():
    """Leave the pictures of runs out: they take as long as all the rest of a small one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("opl.run.stages.draw_charts", lambda *_: {})
        yield
