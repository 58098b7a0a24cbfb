"""What became of a job, as far as it came: what is written, printed and told to other programs."""

from __future__ import annotations

from dataclasses import dataclass, field

from opl.errors import NoPathError
from opl.findings import Finding
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.motion.feed import SlowStretch
from opl.motion.figures import Figures
from opl.planning.fixed import FixedContact
from opl.planning.plan import Plan
from opl.program.moves import Program
from opl.proof.read_back import FileProof
from opl.verification.replay import Verification


@dataclass
class Outcome:
    """What became of a job, as far as it came.

    Attributes:
        job: The job.
        status: ``ok``, ``no_path`` or ``unsafe``.
        seconds: Time of each stage.
        points: The cutter points.
        warnings: What is doubtful about them.
        fixed: The contact-fixed path.
        plan: The found path and its motion.
        recursive: The path of the paper's search from the best start node.
        paper_start: The path of the paper's search from the paper's own start node, or None if
            there is none.
        compared: The figures of every path, by what it is.
        slow: Where the ground point is slower than the feed; None without a motion.
        verification: What the replay found.
        program: The moves of the program.
        file: What was found when its files were read back; None where opl cannot.
        refusal: Why there is no path, if so.
        remedies: Single changes of the job that would make it possible.
        files: Texts to be written, by file name.
    """

    job: Job
    status: str = "ok"
    seconds: dict[str, float] = field(default_factory=dict)
    points: CutterPoints | None = None
    warnings: tuple[Finding, ...] = ()
    fixed: FixedContact | None = None
    plan: Plan | None = None
    recursive: Plan | None = None
    paper_start: Plan | None = None
    compared: dict[str, Figures] = field(default_factory=dict)
    slow: tuple[SlowStretch, ...] | None = None
    verification: Verification | None = None
    program: Program | None = None
    file: FileProof | None = None
    refusal: NoPathError | None = None
    remedies: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
