"""The clients for other programs that the documentation shows, against the service itself."""

import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import opl
from opl.client import Client, ServiceError
from tests.support.jobs import POST, write_job
from tests.support.serving import serving

pytest.importorskip("fastapi", reason="needs the extra opl[service]")
CLIENT = Path(opl.__file__).parents[1] / "docs" / "clients" / "opl_run.py"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with serving(tmp_path_factory.mktemp("clients") / "store", "--workers", "1") as client:
        yield client._address


def run(address, folder, out):
    """Run the client without opl on its path; return how it ended."""
    return subprocess.run(
        [sys.executable, "-I", CLIENT, address, folder, out], capture_output=True, text=True
    )


def test_the_python_client_fetches_a_program(address, tmp_path):
    job = write_job(tmp_path / "job", {"name": "CLIENT"})
    ended = run(address, job.parent, tmp_path / "out")
    assert ended.returncode == 0, ended.stderr
    program = (tmp_path / "out" / "CLIENT.JBI").read_bytes()
    assert program.startswith(b"/JOB\r\n//NAME CLIENT\r\n")
    assert (tmp_path / "out" / "result.json").is_file()
    assert len(CLIENT.read_text(encoding="utf-8").splitlines()) <= 30  # as the documentation says


def test_it_says_why_there_is_none(address, tmp_path):
    job = write_job(tmp_path / "job", {"obstacles": [POST]})
    ended = run(address, job.parent, tmp_path / "out")
    assert ended.returncode == 1 and "cutter point" in ended.stderr
    assert "Traceback" not in ended.stderr and not (tmp_path / "out").exists()
    (job.parent / "job.yaml").unlink()
    ended = run(address, job.parent, tmp_path / "out")
    assert ended.returncode == 1 and "job.yaml" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("answer", "status", "message"),
    [(b"413 Too Large", 413, "Too Large"), (b"200 OK", 0, "does not answer: IncompleteRead")],
)
def test_an_answer_that_breaks_off_is_told(answer, status, message):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def begin():
            there, _ = listener.accept()
            with there:
                there.recv(10_000)
                there.sendall(b"HTTP/1.1 " + answer + b"\r\nContent-Length: 9\r\n\r\n")

        threading.Thread(target=begin, daemon=True).start()
        with pytest.raises(ServiceError) as refused:
            Client(f"http://127.0.0.1:{listener.getsockname()[1]}").job("a")
    assert refused.value.status == status and refused.value.message.startswith(message)
