"""A client of the service, for plug-ins and scripts: nothing but Python's own library is needed.

    from opl.client import Client

    service = Client("http://127.0.0.1:8765")
    job = service.submit("run", {"job.yaml": text, "part.stl": data, "surface.json": more})
    for job in service.follow(job.id):
        print(job.state, job.stage, f"{100 * job.fraction:.0f} %")
    if job.status == "ok":
        service.fetch_all(job, "programs")

The file runs alone: copied into a plug-in it needs no opl, so versions never meet.
"""

from __future__ import annotations

import http.client
import json
import urllib.error
import urllib.parse
import urllib.request
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

WAIT = 30.0  # [s] for an answer


class ServiceError(Exception):
    """The service refused a request, or did not answer.

    Attributes:
        status: Of HTTP; 0 if there was no answer.
        where: What of the request is to blame.
        message: Why.
    """

    def __init__(self, status: int, where: str, message: str) -> None:
        super().__init__(f"{where}: {message}" if where else message)
        self.status, self.where, self.message = status, where, message


@dataclass(frozen=True)
class RemoteFile:
    """A file that a job made: its name, size in bytes, SHA-256, and path at the service."""

    name: str
    size: int
    sha256: str
    url: str


@dataclass(frozen=True)
class RemoteJob:
    """A job of the service.

    Attributes:
        id: Its id; the same task with the same files has the same.
        name: For people.
        task: ``run``, ``check``, ``points``, ``verify`` or ``faces``.
        state: ``queued``, ``running``, ``done``, ``failed`` or ``cancelled``.
        stage: Of a running job, what it does.
        fraction: How much of the stage is done, 0 to 1.
        value: Of the best path that the search has found by now, of what it keeps small, in rad or
            s; None before.
        lower_bound: What the search has proven by now that no path is below; None before.
        status: What became of it: ``ok``, ``no_path``, ``unsafe``, ``not proven``, ``bad input`` or
            ``error``; None while it has not ended.
        exit_status: As of the command line.
        message: Why there is no program.
        files: What it made.
        result: Its figures, None if there are none or they were not asked for.
        report: Path of its page at the service.
    """

    id: str
    name: str
    task: str
    state: str
    stage: str
    fraction: float
    value: float | None
    lower_bound: float | None
    status: str | None
    exit_status: int | None
    message: str | None
    files: tuple[RemoteFile, ...]
    result: Any
    report: str | None

    @property
    def ended(self) -> bool:
        """Whether nothing more will become of it."""
        return self.state in ("done", "failed", "cancelled")


class Client:
    """Talks to one service.

    Args:
        address: Where it listens, as ``http://127.0.0.1:8765``.
        token: Its secret, if it has one.
    """

    def __init__(self, address: str, token: str | None = None) -> None:
        self._address = address.rstrip("/")
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}

    def health(self) -> dict[str, Any]:
        """Return whether the service can work: ``status``, ``version``, ``workers``, ``ready``."""
        found: dict[str, Any] = json.loads(self._ask("GET", "/health"))
        return found

    def submit(
        self,
        task: str,
        files: Mapping[str, str | bytes],
        *,
        job: str = "job.yaml",
        method: str | None = None,
        programs: Sequence[str] = (),
        unit: str | None = None,
        again: bool = False,
        wait_s: float = 0.0,
    ) -> RemoteJob:
        """Submit a task with its files.

        Args:
            task: ``run``, ``check``, ``points``, ``verify`` or ``faces``.
            files: Text or bytes by relative name, as the job names them.
            job: Which of them is the job; of ``faces`` the part file.
            method: Search to use instead of the job's own.
            programs: Which of them are the program to be verified.
            unit: Of a mesh whose faces are asked for, ``mm`` or ``m``.
            again: Do it again even if it is done.
            wait_s: Time to wait for its end, 60 s at the most.

        Raises:
            ServiceError: If it is refused.
        """
        fields = [("task", task), ("job", job), *(("programs", name) for name in programs)]
        given = (("method", method), ("unit", unit), ("again", "true" if again else None))
        fields += [(name, value) for name, value in given if value is not None]
        kind, body = _form(fields, files)
        query = urllib.parse.urlencode({"wait_s": wait_s})
        found = self._ask("POST", f"/v1/jobs?{query}", body, kind, WAIT + wait_s)
        return _job(json.loads(found))

    def submit_folder(self, task: str, job: Path, **options: Any) -> RemoteJob:
        """Submit a job file with all files of its folder and the folders in it; see `submit`."""
        folder = job.parent
        files = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file() and not any(part[0] == "." for part in path.relative_to(folder).parts)
        }
        return self.submit(task, files, job=job.name, **options)

    def job(self, id_: str) -> RemoteJob:
        """Return a job as it is now, with its figures."""
        return _job(json.loads(self._ask("GET", f"/v1/jobs/{id_}")))

    def jobs(self, state: str | None = None, most: int = 100) -> list[RemoteJob]:
        """Return the newest jobs, of one state or of all, without their figures."""
        chosen = {"most": str(most), **({} if state is None else {"state": state})}
        found = json.loads(self._ask("GET", f"/v1/jobs?{urllib.parse.urlencode(chosen)}"))
        return [_job(one) for one in found["jobs"]]

    def counts(self) -> dict[str, int]:
        """Return how many jobs there are in each state."""
        found: dict[str, int] = json.loads(self._ask("GET", "/v1/jobs?most=1"))["counts"]
        return found

    def follow(self, id_: str) -> Iterator[RemoteJob]:
        """Yield a job whenever something of it has changed; with its figures when it has ended."""
        request = self._request("GET", f"/v1/jobs/{id_}/events")
        with self._answer(request, WAIT) as answer:
            for line in answer:
                if line.startswith(b"data: "):
                    found = _job(json.loads(line[6:]))
                    if found.ended:
                        break
                    yield found
        yield self.job(id_)

    def cancel(self, id_: str) -> RemoteJob:
        """Cancel a job that is queued or running."""
        return _job(json.loads(self._ask("POST", f"/v1/jobs/{id_}/cancel")))

    def forget(self, id_: str) -> None:
        """Let the service forget a job that has ended, with its files."""
        self._ask("DELETE", f"/v1/jobs/{id_}")

    def fetch(self, job: RemoteJob, name: str) -> bytes:
        """Return a file that a job made."""
        return self._ask("GET", f"/v1/jobs/{job.id}/files/{urllib.parse.quote(name)}")

    def fetch_all(self, job: RemoteJob, folder: str | Path) -> list[Path]:
        """Write all files that a job made into a folder, which is made if needed."""
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        written = []
        for file in job.files:
            path = place / Path(file.name).name
            path.write_bytes(self.fetch(job, file.name))
            written.append(path)
        return written

    def page_address(self, job: RemoteJob) -> str | None:
        """Return the address of the page of a job, None if it has none."""
        return None if job.report is None else self._address + job.report

    def _request(
        self, method: str, path: str, body: bytes | None = None, kind: str | None = None
    ) -> urllib.request.Request:
        headers = {**self._headers, **({} if kind is None else {"Content-Type": kind})}
        return urllib.request.Request(self._address + path, body, headers, method=method)

    def _ask(
        self,
        method: str,
        path: str,
        body: bytes | None = None,
        kind: str | None = None,
        wait: float = WAIT,
    ) -> bytes:
        with self._answer(self._request(method, path, body, kind), wait) as answer:
            content: bytes = answer.read()
            return content

    @contextmanager
    def _answer(self, request: urllib.request.Request, wait: float) -> Iterator[Any]:
        """Yield an answer to be read; what breaks off meanwhile becomes a `ServiceError`."""
        try:
            with urllib.request.urlopen(request, timeout=wait) as answer:
                yield answer
        except urllib.error.HTTPError as error:
            raise _refusal(error) from error
        except (OSError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", error)
            raise ServiceError(0, self._address, f"does not answer: {reason}") from error


def _refusal(error: urllib.error.HTTPError) -> ServiceError:
    """Return what the service says against a request."""
    try:
        content = error.read()
    except (OSError, http.client.HTTPException):  # it does not wait until all has been sent
        return ServiceError(error.code, "", str(error.reason))
    try:
        answer = json.loads(content)
        return ServiceError(error.code, str(answer["where"]), str(answer["message"]))
    except (ValueError, KeyError, TypeError):
        return ServiceError(error.code, "", content.decode("utf-8", "replace")[:200])


def _job(found: Mapping[str, Any]) -> RemoteJob:
    names = (
        "id", "name", "task", "state", "stage", "fraction", "value", "lower_bound", "status",
        "exit_status", "message", "report",
    )  # fmt: skip
    files = (
        RemoteFile(one["name"], one["size"], one["sha256"], one["url"]) for one in found["files"]
    )
    return RemoteJob(
        **{name: found[name] for name in names}, files=tuple(files), result=found.get("result")
    )


def _form(fields: Sequence[tuple[str, str]], files: Mapping[str, str | bytes]) -> tuple[str, bytes]:
    """Return the type and the bytes of a form with fields and files (RFC 7578)."""
    border = uuid.uuid4().hex
    pieces = []
    for name, value in fields:
        head = f'--{border}\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n'
        pieces.append(head.encode() + value.encode() + b"\r\n")
    for name, content in files.items():
        quoted = name.replace('"', "%22").replace("\r", "%0D").replace("\n", "%0A")
        head = (
            f'--{border}\r\nContent-Disposition: form-data; name="files"; filename="{quoted}"\r\n'
            "Content-Type: application/octet-stream\r\n\r\n"
        )
        data = content.encode() if isinstance(content, str) else content
        pieces.append(head.encode() + data + b"\r\n")
    return f"multipart/form-data; boundary={border}", b"".join(
        pieces
    ) + f"--{border}--\r\n".encode()
