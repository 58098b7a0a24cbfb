"""Golden files: compared byte for byte, rewritten only on demand (pytest --rewrite-golden)."""

from pathlib import Path

import pytest

GOLDEN = Path(__file__).parent / "golden"


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
