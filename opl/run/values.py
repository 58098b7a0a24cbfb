"""What the stages of a run make: each value holds those before it, so its type says how far it is.

    Surfaced -> Prepared -> Planned -> Proven -> Written

A run ends as `Written` or, wherever it stops, as `Refused`. What is `Later` is worked out when it
is first asked for, or beside.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

from opl.errors import NoPathError, OplError, UnsafeError

if TYPE_CHECKING:  # what a stage makes of a value is loaded with the stage
    from opl.files.beside import Later
    from opl.findings import Finding
    from opl.geometry.inspection import Inspection
    from opl.geometry.passes import LaidPasses
    from opl.geometry.toolpath import CutterPoints
    from opl.job.values import Job
    from opl.motion.feed import SlowStretch
    from opl.motion.figures import Figures
    from opl.motion.motion import Motion, TimedMotion, VerifiedMotion
    from opl.motion.timing import Timing
    from opl.planning.fixed_contact import FixedContact
    from opl.planning.plan import Plan
    from opl.planning.problem import GrindingProblem
    from opl.planning.survey import NodeSurvey
    from opl.program.moves import Program
    from opl.proof.read_back import FileProof
    from opl.report.packing import Packer
    from opl.run.watch import Stage
    from opl.verification.replay import Verification
    from opl.verification.seen import Seen


@dataclass(frozen=True, eq=False)
class Surfaced:
    """A job whose surface is cut into cutter points.

    Attributes:
        job: The job.
        laid: The cutter points, and how the surface bends there.
        inspection: What is doubtful about them.
    """

    job: Job
    laid: LaidPasses
    inspection: Inspection

    @property
    def points(self) -> CutterPoints:
        """The cutter points."""
        return self.laid.points

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What is doubtful about the cutter points."""
        return self.inspection.findings


@dataclass(frozen=True, eq=False)
class Prepared:
    """Cutter points with everything that a search needs.

    Attributes:
        surfaced: The cutter points.
        problem: Nodes, clearances and scene.
        kept: The same work with the contact kept at t = 0, for comparison.
        paper_start: The figures of what the paper's search finds from its own start node; None if
            that is nothing.
    """

    surfaced: Surfaced
    problem: GrindingProblem
    kept: Later[FixedContact]
    paper_start: Later[Figures | None]

    @property
    def fixed(self) -> FixedContact:
        """The same work with the contact kept at t = 0."""
        return self.kept.value()

    @cached_property
    def survey(self) -> NodeSurvey:
        """Every node of the IK branch that comes farthest, for pictures."""
        from opl.planning.survey import survey_nodes, widest_branch

        problem = self.problem
        return survey_nodes(problem, widest_branch(problem), problem.process.home)


@dataclass(frozen=True, eq=False)
class Charted:
    """What charts show of a path, and those that are files of their own.

    Attributes:
        survey: Every node of the IK branch that the path has in each pass.
        charts: Pictures as SVG texts by file name.
    """

    survey: NodeSurvey
    charts: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Drawn:
    """What the viewer of a page draws of a run.

    Attributes:
        data: What it reads, by name.
        packer: The arrays that this refers to.
        chart: The cells of the contact chart as an image for HTML.
    """

    data: Mapping[str, Any]
    packer: Packer
    chart: str


@dataclass(frozen=True, eq=False)
class Planned:
    """A path and the motion that it became, not verified yet.

    Attributes:
        prepared: What the search was given.
        plan: The path, and its motion as planned.
        comparison: The figures of this path and of those that it is compared with, by what they
            are: ``fixed``, ``paper_start``, ``recursive``, ``optimal``; those that exist.
        exact: The motion through all configurations that were looked at, in no digits.
        timed: The motion through the fewest positions that do, in the digits of the program, with
            its times.
        timing: What is written of it, move by move, and what sets the times.
        seen: What a reader of the program will see of its configurations.
        slow: Where the ground point is slower than the feed.
        charted: What charts show of the path.
        drawn: What the page of the run draws.
    """

    prepared: Prepared
    plan: Plan
    comparison: Later[Mapping[str, Figures]]
    exact: Motion
    timed: TimedMotion
    timing: Timing
    seen: Seen
    slow: tuple[SlowStretch, ...]
    charted: Later[Charted]
    drawn: Later[Drawn]

    @property
    def compared(self) -> Mapping[str, Figures]:
        """The figures of this path and of those that it is compared with."""
        return self.comparison.value()

    @property
    def survey(self) -> NodeSurvey:
        """Every node of the IK branch that the path has in each pass, for pictures."""
        return self.charted.value().survey

    @property
    def surfaced(self) -> Surfaced:
        """The cutter points."""
        return self.prepared.surfaced


@dataclass(frozen=True, eq=False)
class Proven:
    """A motion that passed every check of the replay.

    Attributes:
        planned: The path and its motion.
        verification: What the replay found.
        motion: The motion, verified.
    """

    planned: Planned
    verification: Verification
    motion: VerifiedMotion

    @property
    def prepared(self) -> Prepared:
        """What the search was given."""
        return self.planned.prepared

    @property
    def surfaced(self) -> Surfaced:
        """The cutter points."""
        return self.planned.surfaced


@dataclass(frozen=True, eq=False)
class Written:
    """A finished run: a program, its files, and the proof of these files.

    Attributes:
        proven: The verified motion.
        program: The moves of the program.
        files: Texts by file name: program, table and pictures.
        read_back: What was found when the program was read back from its texts; None for languages
            that opl writes, but does not read.
        seconds: Time of each stage in [s].
        pictures: More files by name that are no texts, only where somebody asked for them.
    """

    proven: Proven
    program: Program
    files: Mapping[str, str]
    read_back: FileProof | None
    seconds: Mapping[Stage, float]
    pictures: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """``ok``."""
        return "ok"

    @property
    def contents(self) -> dict[str, bytes]:
        """All files by name, as their bytes."""
        return {name: text.encode() for name, text in self.files.items()} | dict(self.pictures)

    @property
    def surfaced(self) -> Surfaced:
        """The cutter points."""
        return self.proven.surfaced


@dataclass(frozen=True, eq=False)
class Refused:
    """A finished run without a program, and why.

    Attributes:
        reached: The last value that was made.
        cause: Why there is no program: no path, a replay with findings, or files that do not hold
            what was proven.
        remedies: Single changes of the job that would open a path, one line each.
        seconds: Time of each stage in [s].
        in_vain: Kinds of changes that were tried and open none, one line each.
    """

    reached: Prepared | Planned | Proven
    cause: NoPathError | Verification | FileProof
    remedies: tuple[str, ...]
    seconds: Mapping[Stage, float]
    in_vain: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """``no_path`` or ``unsafe``."""
        return "no_path" if isinstance(self.cause, NoPathError) else "unsafe"

    @property
    def surfaced(self) -> Surfaced:
        """The cutter points."""
        return self.reached.surfaced

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why there is no program, one line each."""
        if isinstance(self.cause, NoPathError):
            return (self.cause.message, *self.cause.reasons)
        return tuple(str(finding) for finding in self.cause.findings)

    @property
    def error(self) -> OplError:
        """The error that a command ends with which needs a program."""
        if isinstance(self.cause, NoPathError):
            return NoPathError(self.cause.message, [*self.cause.reasons, *self.remedies])
        first = "planned, but not proven safe; no program was written"
        return UnsafeError("\n".join([first, *self.reasons]))


Run: TypeAlias = Written | Refused
