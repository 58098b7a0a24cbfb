"""Serving: a store with its crew, an address, and the end of it all."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from opl.errors import InputError
from opl.files.claiming import claimed
from opl.files.reading import MB
from opl.store.events import tell
from opl.store.jobs import Store
from opl.version import VERSION
from opl.work.cluster import Cluster
from opl.work.crew import Crew, Doer
from opl.work.worker import Limits, Worker

LOCAL = ("127.0.0.1", "localhost", "::1")
STORE = "opl-jobs.sqlite"
LEAST_TOKEN = 16  # characters


@dataclass(frozen=True)
class ServiceSettings:
    """How the service runs.

    Attributes:
        folder: Where jobs and their files are kept.
        host: Address to listen on.
        port: Of that address, 0 for any that is free.
        workers: Number of processes.
        token: Secret that each request has to carry; needed beyond this machine.
        seconds: Longest time of a job.
        memory: Most bytes of data of a worker.
        most_bytes: Of a request.
        scheduler: Address of a scheduler of Dask whose workers do the jobs; None for processes
            here.
    """

    folder: Path
    host: str = "127.0.0.1"
    port: int = 8765
    workers: int = 2
    token: str | None = None
    seconds: float = 600.0
    memory: int = 3000 * MB
    most_bytes: int = 100 * MB
    scheduler: str | None = None


def serve(settings: ServiceSettings, listening: Callable[[str], None] | None = None) -> None:
    """Serve jobs over HTTP until the process is told to stop.

    Args:
        settings: How.
        listening: Called with the address as soon as requests are taken.

    Raises:
        InputError: If the extra is not installed, a token is missing or too short, the address is
            taken, or another service uses the folder.
    """
    try:
        import uvicorn

        from opl.service.app import make_app
    except ImportError as error:
        raise InputError("opl serve", "needs the extra: pip install 'opl[service]'") from error
    if settings.token is None and settings.host not in LOCAL:
        raise InputError("--host", f"{settings.host} is for others as well, which needs a token")
    if settings.token is not None and len(settings.token) < LEAST_TOKEN:
        raise InputError("token", f"must have at least {LEAST_TOKEN} characters")
    with claimed(settings.folder):  # by one service
        store = Store(settings.folder / STORE)
        limits = Limits(settings.seconds, settings.memory)
        doers: Sequence[Doer]
        if settings.scheduler is not None:
            cluster = Cluster(settings.scheduler)
            doers = cluster.doers(limits, cluster.threads)
        else:
            doers = [Worker(limits, warm=True) for _ in range(settings.workers)]
        with _bound(settings.host, settings.port) as listener:
            app = make_app(store, Crew(store, doers), settings.token, settings.most_bytes)
            config = uvicorn.Config(
                app, log_config=None, access_log=False, timeout_graceful_shutdown=1, lifespan="on"
            )
            host, port = listener.getsockname()[:2]
            address = f"http://{f'[{host}]' if ':' in host else host}:{port}"
            tell("listening", address=address, version=VERSION)
            if listening is not None:
                listening(address)
            with _signals_ignored():  # uvicorn takes them meanwhile and hands them on at its end
                uvicorn.Server(config).run(sockets=[listener])
            tell("stopped")


@contextmanager
def _bound(host: str, port: int) -> Iterator[socket.socket]:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family)
    except OSError as error:
        message = f"cannot listen on {host}, port {port}: {error.strerror}"
        raise InputError("opl serve", message) from error
    with listener:
        yield listener


@contextmanager
def _signals_ignored() -> Iterator[None]:
    before = {one: signal.signal(one, signal.SIG_IGN) for one in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
