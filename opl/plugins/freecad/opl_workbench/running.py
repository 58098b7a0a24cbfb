"""Asking the service for cutter points and for a program; answers are kept in the document.

What talks to the service touches no document, so it may run in a thread of its own; what changes
the document has to run in FreeCAD's.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import FreeCAD

from .client import Client, RemoteJob
from .job_text import asked_digest, job_files
from .keeping import keep, kept

PREFERENCES = "User parameter:BaseApp/Preferences/Mod/opl"
ADDRESS = "http://127.0.0.1:8765"
SENT = "job/"  # folder of what was sent, among the files of a run
RESULT = "result.json"

Tell = Callable[[RemoteJob], None]


@dataclass(frozen=True)
class Request:
    """What is asked of the service.

    Attributes:
        task: ``points`` or ``run``.
        files: The files of the job.
        asked: Digest of the object, to know later whether it was changed.
    """

    task: str
    files: Mapping[str, bytes]
    asked: str


@dataclass(frozen=True)
class Answer:
    """What the service answered: the job when it had ended, and the files that it made."""

    job: RemoteJob
    files: Mapping[str, bytes]


def service() -> Client:
    """Return the client of the service that FreeCAD's preferences name.

    The token is never kept in a document; OPL_TOKEN is taken before that of the preferences.
    """
    group = FreeCAD.ParamGet(PREFERENCES)
    token = os.environ.get("OPL_TOKEN") or group.GetString("Token", "")
    return Client(group.GetString("Address", ADDRESS), token or None)


def request(obj: Any, task: str) -> Request:
    """Return what is to be asked for a job.

    Raises:
        ValueError: If something of the job cannot be used.
    """
    return Request(task, job_files(obj), asked_digest(obj))


def ask(client: Client, request: Request, tell: Tell = lambda job: None) -> Answer:
    """Ask the service, and tell of every step until it has ended.

    Raises:
        ServiceError: If the service refuses, or does not answer.
    """
    job = client.submit(request.task, request.files)
    tell(job)
    for later in client.follow(job.id):
        job = later
        tell(job)
    return Answer(job, {file.name: client.fetch(job, file.name) for file in job.files})


def store(obj: Any, request: Request, answer: Answer) -> None:
    """Keep an answer in the object of a job, with what had been asked."""
    job = answer.job
    obj.Status, obj.Message = job.status or job.state, job.message or ""
    obj.Asked = request.asked
    if request.task == "points":
        keep(obj, "PointsKept", answer.files)
        if job.status == "ok":
            obj.Status = "points"
    else:
        sent = {SENT + name: content for name, content in request.files.items()}
        keep(obj, "RunKept", {**sent, **answer.files})
        obj.JobId = job.id
    obj.Figures = _figures(request.task, job)


def plan(obj: Any, tell: Tell = lambda job: None, client: Client | None = None) -> Any:
    """Ask for cutter points, then for the program; keep both. Return the object."""
    client = client or service()
    for task in ("points", "run"):
        asked = request(obj, task)
        answer = ask(client, asked, tell)
        store(obj, asked, answer)
        if answer.job.status != "ok":
            break
    return obj


def show_points(obj: Any, client: Client | None = None) -> Any:
    """Ask for cutter points and keep them. Return the object."""
    asked = request(obj, "points")
    store(obj, asked, ask(client or service(), asked))
    return obj


def save_programs(obj: Any, folder: str) -> list[str]:
    """Write the files of a run that is kept into a folder; return their paths.

    Raises:
        ValueError: If there is no program, or if it is older than what is asked for now.
    """
    if obj.Status != "ok":
        raise ValueError(f"{obj.Label}: there is no program: {obj.Status or 'not run yet'}")
    os.makedirs(folder, exist_ok=True)
    written = []
    for name, content in kept(obj, "RunKept").items():
        if not name.startswith(SENT):
            path = os.path.join(folder, os.path.basename(name))
            with open(path, "wb") as file:
                file.write(content)
            written.append(path)
    return written


def result_of(obj: Any) -> dict[str, Any]:
    """Return ``result.json`` of the run that is kept, empty if there is none."""
    content = kept(obj, "RunKept").get(RESULT)
    return {} if content is None else json.loads(content)


def _figures(task: str, job: RemoteJob) -> str:
    found = job.result or {}
    if task == "points":
        if "cutter_points" not in found:
            return ""
        return (
            f"{found['cutter_points']} cutter points in {found['passes']} passes, pitch "
            f"{found['pitch_mm']:g} mm, {found['uncovered_percent']:g} % of the area not covered"
        )
    path, cycle, proof = (found.get(key) or {} for key in ("path", "cycle", "verification"))
    words = []
    if "joint_range_sum_rad" in path:
        words.append(f"joint range sum {path['joint_range_sum_rad']:.3f} rad")
    if "total_s" in cycle:
        words.append(f"cycle {cycle['total_s']:.1f} s")
    if proof.get("min_clearance_mm") is not None:
        words.append(f"least clearance {proof['min_clearance_mm']:.1f} mm")
    return ", ".join(words)
