"""What the service sends and takes, as models: its OpenAPI description is made from them."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict, Field, JsonValue

from opl.files.documents import Document

_EXAMPLE_FILES: dict[str, JsonValue] = {
    "job.yaml": {"text": "name: V_SHAPE\nrobot: mh24\n..."},
    "surface.json": {"text": '{"degree_u": 2, ...}'},
    "v_shape.stl": {"base64": "c29saWQgdg=="},
}


class SentFile(Document):
    """A file: its text, or its bytes in base64."""

    text: str | None = None
    base64: str | None = None


class Submitted(Document):
    """A task with its files."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"task": "run", "job": "job.yaml", "files": _EXAMPLE_FILES}]
        }
    )

    task: Literal["run", "check", "points", "verify", "faces"] = Field(
        default="run",
        description="run: plan, prove and write the program. check: validate, say what would be "
        "done. points: cutter points as table, picture and page. verify: prove the programs. "
        "faces: list the faces of a part file, which stands in `job`.",
    )
    job: str = Field(default="job.yaml", description="Which of the files is the job.")
    method: Literal["recursive", "optimal"] | None = Field(
        default=None, description="Search to use instead of the job's own."
    )
    programs: list[str] = Field(
        default=[], description="Of verify: which of the files are the program."
    )
    unit: Literal["mm", "m"] | None = Field(
        default=None, description="Of faces: the unit of a mesh file."
    )
    again: bool = Field(default=False, description="Do it again even if it is done.")


class SubmittedFiles(Submitted):
    """A task with its files in JSON."""

    files: dict[str, SentFile] = Field(
        description="By relative name, as the job names them; folders with /."
    )


class MadeFile(Document):
    """A file that a job made."""

    name: str
    size: int = Field(description="In bytes.")
    sha256: str
    url: str


class JobView(Document):
    """A job: how far it is, and what became of it."""

    id: str = Field(description="Digest of all that the job depends on: the same job, the same id.")
    name: str
    task: str
    state: Literal["queued", "running", "done", "failed", "cancelled"]
    stage: str = Field(description="Of a running job, what it does.")
    fraction: float = Field(description="How much of the stage is done, 0 to 1.")
    value: float | None = Field(
        description="Of the best path that the search has found by now, of what it keeps small, in "
        "rad or s; null before."
    )
    lower_bound: float | None = Field(
        description="What the search has proven by now that no path is below; null before."
    )
    cancelling: bool
    attempts: int
    created: float = Field(description="Seconds since 1970.")
    started: float | None
    ended: float | None
    status: str | None = Field(
        description="ok, no_path, unsafe, not proven, bad input or error; null while not ended."
    )
    exit_status: int | None = Field(description="That of the command line: 0, 1, 2, 3 or 4.")
    message: str | None = Field(description="Why there is no program: file, key, place, amount.")
    files: list[MadeFile]
    result: Any = Field(
        default=None, description="The figures: of run the content of result.json. Not in lists."
    )
    report: str | None = Field(description="Where the page of the run is.")
    events: str = Field(description="Where its progress is told, as server-sent events.")


class JobList(Document):
    """Jobs, the newest first."""

    jobs: list[JobView]
    counts: dict[str, int] = Field(description="How many there are in each state.")


class Refusal(Document):
    """Why a request is refused."""

    where: str = Field(description="What of the request is to blame.")
    message: str


class Health(Document):
    """Whether the service can work."""

    status: Literal["ok", "starting", "trouble"]
    version: str
    workers: int
    ready: int = Field(description="Workers that have loaded all that computes.")
    message: str = Field(default="", description="What is wrong, of status trouble.")
