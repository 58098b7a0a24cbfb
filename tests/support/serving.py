"""The service in a process of its own."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import opl
from opl.client import Client

CHILD = {**os.environ, "PYTHONPATH": str(Path(opl.__file__).parents[1])}
START = "import sys; from opl.cli.commands import main; sys.exit(main(prog_name='opl'))"


def started(store, *options, env=()):
    """Start a service in a session of its own; return its process and its address."""
    process = subprocess.Popen(
        [sys.executable, "-c", START, "serve", "--store", str(store), "--port", "0", *options],
        env={**CHILD, **dict(env)},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    line = process.stdout.readline()
    assert line.startswith("opl serves http://"), line
    return process, line.split()[2].rstrip(",")


def stopped(process, number=signal.SIGTERM):
    """Stop a service; return its exit status."""
    process.send_signal(number)
    status = process.wait(60)
    process.stdout.close()
    return status


def ready(client):
    """Wait until all workers of a service are warm."""
    deadline = time.monotonic() + 120.0
    while client.health()["status"] != "ok":
        assert time.monotonic() < deadline
        time.sleep(0.1)
    return client


@contextmanager
def serving(store, *options, env=()):
    """Run a service; yields its client when all workers are warm."""
    process, address = started(store, *options, env=env)
    try:
        client = ready(Client(address))
        client.pid = process.pid
        yield client
    finally:
        assert stopped(process) == 0
