"""The routes of the service. Each answers from the store; the work is done by its crew."""

# no `from __future__ import annotations`: FastAPI reads those of routes that are made here
import asyncio
import base64
import binascii
import json
import shutil
import time
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import FileResponse, JSONResponse, StreamingResponse
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile

from opl.errors import InputError
from opl.files import documents
from opl.service import models
from opl.service.submission import JOBS, MOST_FILES, Submission, checked, figures_of, made_by, put
from opl.store.jobs import Store
from opl.store.values import State, StoredJob, Task

LOOK = 0.05  # [s] between two looks at a job that somebody waits for
ALIVE = 10.0  # [s] between two signs of life where nothing happens
LONGEST_WAIT = 60.0  # [s]
MOST_LISTED = 1000
PAGES = ("report.html",)
# a page of a job may run its own scripts, but is a stranger to the service
SANDBOX = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data:"
)

_REFUSALS: dict[int | str, dict[str, Any]] = {
    code: {"model": models.Refusal} for code in (400, 401, 403, 404, 413)
}
_BODY = {
    "required": True,
    "content": {
        "application/json": {"schema": models.SubmittedFiles.model_json_schema()},
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "description": "The fields of a task as text, `programs` once for each, and the "
                "files as parts `files`, each with its relative name as file name.",
                "properties": {
                    **models.Submitted.model_json_schema()["properties"],
                    "files": {"type": "array", "items": {"type": "string", "format": "binary"}},
                },
            }
        },
    },
}


def make_routes(store: Store, wake: Callable[[], None]) -> APIRouter:
    """Return the routes of version 1.

    Args:
        store: The jobs.
        wake: Called when there is something to do.
    """
    router = APIRouter(prefix="/v1", responses=_REFUSALS)

    async def job_of(id_: str) -> StoredJob:
        found = await run_in_threadpool(store.get, id_)
        if found is None:
            raise HTTPException(404, {"where": "id", "message": f"no job {id_[:40]!r}"})
        return found

    @router.post("/jobs", status_code=202, openapi_extra={"requestBody": _BODY},
                 responses={200: {"model": models.JobView}}, summary="Submit a job")  # fmt: skip
    async def submit(
        request: Request,
        wait_s: Annotated[float, Query(ge=0.0, le=LONGEST_WAIT)] = 0.0,
    ) -> models.JobView:
        """Submit a task with its files; wait for its end for a time, if wished.

        The same task with the same files is the same job: one that is done is answered at once.
        """
        submission, again = await _read(request)
        job = await run_in_threadpool(put, store, submission, again)
        wake()
        until = time.monotonic() + wait_s
        while not job.state.ended and time.monotonic() < until:
            await asyncio.sleep(LOOK)
            job = await job_of(job.id)
        shown = await run_in_threadpool(_view, store, job, True)
        return JSONResponse(shown.model_dump(), 200 if job.state.ended else 202)  # type: ignore[return-value]

    @router.get("/jobs", summary="List jobs")
    def listed(
        state: State | None = None, most: Annotated[int, Query(ge=1, le=MOST_LISTED)] = 100
    ) -> models.JobList:
        """List the newest jobs, of one state or of all."""
        found = [_view(store, job, False) for job in store.jobs(state, most)]
        return models.JobList(jobs=found, counts=store.counts())

    @router.get("/jobs/{id}", summary="Show a job")
    async def show(id: str) -> models.JobView:
        """Show how far a job is, and what became of it."""
        return await run_in_threadpool(_view, store, await job_of(id), True)

    @router.get("/jobs/{id}/events", response_class=StreamingResponse, summary="Follow a job",
                responses={200: {"content": {"text/event-stream": {}}}})  # fmt: skip
    async def events(id: str, request: Request) -> StreamingResponse:
        """Follow a job as server-sent events.

        Each event is called `job` and holds the job as JSON, without its figures; the last one has
        a state of done, failed or cancelled.
        """
        first = await job_of(id)
        headers = {"Cache-Control": "no-cache"}
        stream = _followed(store, first, request)
        return StreamingResponse(stream, media_type="text/event-stream", headers=headers)

    @router.get("/jobs/{id}/files/{name}", response_class=FileResponse, summary="Fetch a file")
    async def fetch(id: str, name: str) -> FileResponse:
        """Fetch a file that a job made."""
        job = await job_of(id)
        path = made_by(store, job, name)
        if path is None or not path.is_file():
            raise HTTPException(
                404, {"where": "name", "message": f"the job made no file {name[:80]!r}"}
            )
        headers = {"X-Content-Type-Options": "nosniff"}
        if name.endswith((".html", ".svg")):
            headers["Content-Security-Policy"] = SANDBOX
            return FileResponse(path, headers=headers)
        return FileResponse(path, headers=headers, media_type="application/octet-stream")

    @router.get("/jobs/{id}/report", response_class=FileResponse, summary="The page of a run")
    async def report(id: str) -> FileResponse:
        """Fetch the page of a run, or of cutter points."""
        page = _page(await job_of(id))
        return await fetch(id, page or PAGES[0])

    @router.post("/jobs/{id}/cancel", summary="Cancel a job")
    async def cancel(id: str) -> models.JobView:
        """Cancel a job that is queued or running; one that has ended stays as it is."""
        await job_of(id)
        await run_in_threadpool(store.cancel, id)
        return await run_in_threadpool(_view, store, await job_of(id), False)

    @router.delete("/jobs/{id}", status_code=204, summary="Forget a job")
    async def forget(id: str) -> None:
        """Forget a job that has ended, with its files."""
        await job_of(id)
        if not await run_in_threadpool(store.remove, id):
            raise HTTPException(409, {"where": "id", "message": "has not ended; cancel it first"})
        await run_in_threadpool(shutil.rmtree, store.path.parent / JOBS / id, True)

    return router


async def _read(request: Request) -> tuple[Submission, bool]:
    """Return what a request submits, and whether it is to be done again."""
    files: dict[str, bytes]
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if kind == "application/json":
        try:
            content = json.loads(await request.body())
        except (ValueError, RecursionError) as error:
            raise InputError("body", "is not JSON") from error
        whole = documents.check(content, models.SubmittedFiles, "body")
        fields: models.Submitted = whole
        files = {name: _bytes_of(name, one) for name, one in whole.files.items()}
    elif kind == "multipart/form-data":
        async with request.form(max_files=MOST_FILES, max_fields=MOST_FILES) as form:
            given: dict[str, Any] = {}
            files = {}
            for key, value in form.multi_items():
                if isinstance(value, UploadFile):
                    name = value.filename or key
                    if name in files:
                        raise InputError(f"file {name[:60]!r}", "is sent twice")
                    files[name] = await value.read()
                elif key == "programs":
                    given.setdefault(key, []).append(value)
                elif key == "again":
                    given[key] = value == "true"
                else:
                    given[key] = value
            fields = documents.check(given, models.Submitted, "body")
    else:
        raise InputError("Content-Type", "must be application/json or multipart/form-data")
    task = Task(
        fields.task, fields.job, "", method=fields.method, programs=tuple(fields.programs),
        unit=fields.unit,
    )  # fmt: skip
    return checked(task, files), fields.again


def _bytes_of(name: str, file: models.SentFile) -> bytes:
    if (file.text is None) == (file.base64 is None):
        raise InputError(f"files.{name[:60]}", "must have text or base64, one of them")
    try:
        if file.text is not None:
            return file.text.encode("utf-8")
        return base64.b64decode(file.base64 or "", validate=True)
    except (binascii.Error, UnicodeEncodeError, ValueError) as error:
        raise InputError(f"files.{name[:60]}", f"cannot be decoded: {error}") from error


async def _followed(store: Store, job: StoredJob, request: Request) -> AsyncIterator[str]:
    seen: tuple[object, ...] | None = None
    said = time.monotonic()
    while True:
        now = (job.state, job.progress, job.cancelling)
        if now != seen:
            seen, said = now, time.monotonic()
            shown = _view(store, job, False).model_dump(exclude={"result"})
            yield f"event: job\ndata: {json.dumps(shown)}\n\n"
            if job.state.ended:
                return
        elif time.monotonic() - said > ALIVE:
            said = time.monotonic()
            yield ": still there\n\n"
        await asyncio.sleep(LOOK)
        if await request.is_disconnected():
            return
        found = await run_in_threadpool(store.get, job.id)
        if found is None:  # it ended and was forgotten
            return
        job = found


def _page(job: StoredJob) -> str | None:
    files: Mapping[str, Any] = {} if job.outcome is None else job.outcome.files
    return next((name for name in files if name.endswith(".html")), None)


def _view(store: Store, job: StoredJob, whole: bool) -> models.JobView:
    outcome, own = job.outcome, f"/v1/jobs/{job.id}"
    files = {} if outcome is None else outcome.files
    return models.JobView(
        id=job.id,
        name=job.name,
        task=job.task.kind,
        state=job.state.value,
        **vars(job.progress),
        cancelling=job.cancelling,
        attempts=job.attempts,
        created=job.created,
        started=job.started,
        ended=job.ended,
        status=None if outcome is None else outcome.status,
        exit_status=None if outcome is None else outcome.exit_status,
        message=None if outcome is None else outcome.message,
        files=[
            models.MadeFile(name=name, size=one.size, sha256=one.digest, url=f"{own}/files/{name}")
            for name, one in files.items()
        ],
        result=figures_of(store, job) if whole else None,
        report=None if _page(job) is None else f"{own}/report",
        events=f"{own}/events",
    )
