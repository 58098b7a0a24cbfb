"""The service as a whole: routes, health and metrics, on a store, with its crew of workers."""

# no `from __future__ import annotations`: FastAPI reads those of routes that are made here
import resource
import sys
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from fastapi.requests import Request
from fastapi.responses import JSONResponse, PlainTextResponse
from starlette.exceptions import HTTPException

from opl.errors import InputError
from opl.service.guard import Guard
from opl.service.models import Health
from opl.service.routes import make_routes
from opl.service.submission import tidy
from opl.store.jobs import Store
from opl.store.values import State
from opl.version import VERSION
from opl.work.crew import Crew


def make_app(store: Store, crew: Crew, token: str | None, most_bytes: int) -> Guard:
    """Return the service as an application (ASGI), which starts and ends the crew with itself.

    Args:
        store: The jobs.
        crew: Who works on them, not started yet.
        token: Secret that each request has to carry, None for none.
        most_bytes: Of a request.
    """

    @asynccontextmanager
    async def living(_: FastAPI) -> AsyncIterator[None]:
        tidy(store)
        crew.start()
        yield
        crew.end()

    inner = FastAPI(
        title="opl",
        version=VERSION,
        description="Jobs of robotic belt grinding: checked, planned, proven and written.",
        lifespan=living,
    )
    inner.include_router(make_routes(store, crew.wake))

    @inner.get("/health", summary="Whether the service can work")
    def health() -> Health:
        ready, fault = crew.ready, crew.fault
        return Health(
            status="trouble" if fault else "ok" if ready == crew.size else "starting",
            version=VERSION,
            workers=crew.size,
            ready=ready,
            message=str(fault or ""),
        )

    @inner.get("/metrics", response_class=PlainTextResponse, summary="Figures for Prometheus")
    def metrics() -> str:
        return "\n".join(_metrics(store, crew, guard.answers)) + "\n"

    @inner.exception_handler(InputError)
    async def refused(_: Request, error: InputError) -> JSONResponse:
        return JSONResponse({"where": error.where, "message": error.message}, 400)

    @inner.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        fault = error.errors()[0]
        where = ".".join(map(str, fault["loc"]))
        return JSONResponse({"where": where, "message": fault["msg"]}, 400)

    @inner.exception_handler(HTTPException)
    async def failed(_: Request, error: HTTPException) -> JSONResponse:
        detail: Any = error.detail
        if not isinstance(detail, dict):
            detail = {"where": "request", "message": str(detail)}
        return JSONResponse(detail, error.status_code, getattr(error, "headers", None))

    guard = Guard(inner, token, most_bytes)
    return guard


def _metrics(store: Store, crew: Crew, answers: Mapping[tuple[str, int], int]) -> Iterator[str]:
    """Yield the lines of the metrics, as Prometheus reads them."""
    yield "# HELP opl_jobs Jobs by state."
    yield "# TYPE opl_jobs gauge"
    for state, count in store.counts().items():
        yield f'opl_jobs{{state="{state}"}} {count}'
    yield "# HELP opl_workers_ready Workers that have loaded all that computes."
    yield "# TYPE opl_workers_ready gauge"
    yield f"opl_workers_ready {crew.ready}"
    yield "# HELP opl_requests_total Requests by method and status."
    yield "# TYPE opl_requests_total counter"
    for (method, status), count in sorted(answers.items()):
        yield f'opl_requests_total{{method="{method}",status="{status}"}} {count}'
    ended = [job for job in store.jobs(most=1000) if job.state is State.DONE]
    spent = sum((job.ended or 0.0) - (job.started or 0.0) for job in ended)
    yield "# HELP opl_job_seconds Time of the newest jobs that are done, at most 1000."
    yield "# TYPE opl_job_seconds summary"
    yield f"opl_job_seconds_sum {spent:.3f}"
    yield f"opl_job_seconds_count {len(ended)}"
    yield "# HELP opl_most_memory_bytes Most memory that the service itself had; without workers."
    yield "# TYPE opl_most_memory_bytes gauge"
    unit = 1 if sys.platform == "darwin" else 1024
    yield f"opl_most_memory_bytes {unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}"
