"""From a job to proven files: the stages in order."""

from __future__ import annotations

from opl.errors import NoFreeMoveError, NoPathError
from opl.files.beside import Beside, Later
from opl.job.refusals import dwell_refusal, keys_named, rest_refusal
from opl.job.values import Job
from opl.least.borders import Nameable
from opl.least.search_space import seams_in
from opl.motion.feed import slow_stretches
from opl.motion.motion import Motion, TimedMotion
from opl.motion.repeats import named_once
from opl.motion.timing import Timing
from opl.planning.plan import Plan
from opl.planning.positions import HALVINGS, with_fewest_positions, with_shorter_moves
from opl.planning.speed_steps import with_speed_steps
from opl.planning.survey import survey_nodes
from opl.program.posts import find_post
from opl.program.settings import MotionForm
from opl.proof.read_back import in_file_digits, position_rule, read_back
from opl.proof.recognised_times import recognised_times
from opl.run.exporting import draw_charts, job_date, load_pictures, render_program
from opl.run.page_data import drawn_run
from opl.run.preparing import prepare
from opl.run.remedies import find_remedies
from opl.run.searches import compare, proves_range, search_path
from opl.run.surfacing import cut_surface
from opl.run.values import (
    Charted,
    Drawn,
    Planned,
    Prepared,
    Proven,
    Refused,
    Run,
    Surfaced,
    Written,
)
from opl.run.watch import Stage, Watch
from opl.verification.replay import replay


def run_job(
    job: Job,
    watch: Watch | None = None,
    workers: int = 1,
    surfaced: Later[Surfaced] | None = None,
) -> Run:
    """Take a job through all stages: cut, plan, verify, write.

    Args:
        job: The job.
        watch: Follows the run, and can cancel it; one for each run, here and in each stage.
        workers: How many processes may work at a time; the same bytes come of any number. With two
            a copy of the process works beside it from the search on, unless it has threads.
        surfaced: Its cutter points, where they are worked out elsewhere; see `job_ahead`.

    Returns:
        `Written` with a proven program, or `Refused` with the reason why there is none.

    Raises:
        InputError: If the surface of the job cannot be cut into passes, lies out of reach, or
            something collides at home.
        OplError: If the program cannot be written for the controller.
        Cancelled: If the run was cancelled.
    """
    job_date()  # refused before the work, not after it
    watch = watch or Watch()
    with Beside(workers > 1) as beside:
        if surfaced is None:
            surfaced = Later(cut_surface, job)
        with watch.stage(Stage.CUTTER_POINTS):
            cut = surfaced.value()
        run = _all_stages(cut, watch, beside)
        if isinstance(run, Refused):
            _work_out(run.reached)
        return run


def _all_stages(surfaced: Surfaced, watch: Watch, beside: Beside) -> Run:
    planned = plan_path(surfaced, watch, beside)
    if isinstance(planned, Refused):
        return planned
    proven = verify_motion(planned, watch, beside)
    return proven if isinstance(proven, Refused) else write_program(proven, watch, beside)


def plan_path(
    surfaced: Surfaced, watch: Watch | None = None, beside: Beside | None = None
) -> Planned | Refused:
    """Plan a path over the wheel and the motion around it, collision-free for the planner.

    Args:
        surfaced: The cutter points.
        watch: Follows the run.
        beside: What may work beside this process, if anything.

    Returns:
        The plan; `Refused` if there is no path, or if the belt would dwell on one spot too long.

    Raises:
        InputError: If cutter points lie out of reach, or something collides at home.
        Cancelled: If the run was cancelled.
    """
    watch = watch or Watch()
    with keys_named(surfaced.job.source):
        return _plan(surfaced, watch, beside or Beside())


def _plan(surfaced: Surfaced, watch: Watch, beside: Beside) -> Planned | Refused:
    prepared, job = prepare(surfaced, watch), surfaced.job
    problem, comparison = prepared.problem, (prepared.kept, prepared.paper_start)
    cell, points = job.cell, surfaced.points
    scene = problem.scene
    beside.start(job, cell, surfaced, points, problem, scene, scene.part, prepared, *comparison)
    seams = Later(seams_in, problem)
    if proves_range(job.search):
        beside.begin(seams)
    for later in (*comparison, Later(load_pictures)):
        beside.begin(later)
    try:
        with watch.search() as follow:
            found = search_path(job.search, problem, _nameable(job), follow, seams, beside)
    except NoPathError as error:
        return _without_path(prepared, error, watch)
    charted = Later(_charted, prepared, found.plan)
    compared = Later(compare, prepared, found)
    if points.n_passes > 1 and job.program.motion is MotionForm.JOINT:
        beside.begin_behind(charted)  # positions of several passes are chosen in turns
    else:
        beside.begin(charted)
    with watch.stage(Stage.MOTION):
        exact = with_speed_steps(found.plan.motion, points, job.process, job.cell.robot)
        exact, motion = _positions(prepared, exact, beside)
        motion = named_once(motion)
        timing, seen = recognised_times(job, points, motion)
        slow = slow_stretches(timing, job.process)
    timed = TimedMotion.passing(motion, timing.timed.duration)
    drawn = Later(_drawn, prepared, charted, timed, timing)
    planned = Planned(
        prepared, found.plan, compared, exact, timed, timing, seen, slow, charted, drawn
    )
    refusal = rest_refusal(timed, points, job.process) or dwell_refusal(slow, job.process)
    return planned if refusal is None else Refused(planned, refusal, (), watch.seconds)


def _positions(prepared: Prepared, exact: Motion, beside: Beside) -> tuple[Motion, Motion]:
    """Return a motion whose moves allow its corners, and what is written and passed of it."""
    surfaced = prepared.surfaced
    job, points = surfaced.job, surfaced.points
    # what is proven is what the digits of the program can say
    motion = in_file_digits(exact, job)
    if job.program.motion is not MotionForm.JOINT:
        return exact, motion
    scene = prepared.problem.scene
    rule = position_rule(job, points, scene.part)
    for rounds_left in reversed(range(HALVINGS + 1)):
        motion, corners = with_fewest_positions(scene, points, motion, job.process, rule, beside)
        if not corners or not rounds_left:
            break
        exact = with_shorter_moves(exact, corners)
        motion = in_file_digits(exact, job)
    return exact, motion


def _charted(prepared: Prepared, plan: Plan) -> Charted:
    path = plan.path
    at_points = path.cutter_point % 1.0 == 0.0
    branches = path.ik_branches[path.pass_index[at_points]]
    survey = survey_nodes(prepared.problem, branches, path.q[at_points])
    return Charted(survey, draw_charts(prepared, plan, survey))


def _drawn(
    prepared: Prepared, charted: Later[Charted], timed: TimedMotion, timing: Timing
) -> Drawn:
    return drawn_run(prepared, charted.value().survey, (timed, timing))


def _work_out(reached: Prepared | Planned | Proven) -> None:
    """Have all that a report needs worked out."""
    planned = reached.planned if isinstance(reached, Proven) else reached
    prepared = planned.prepared if isinstance(planned, Planned) else planned
    prepared.kept.value()
    if isinstance(planned, Planned):
        planned.comparison.value()
        planned.charted.value()
        planned.drawn.value()


def _nameable(job: Job) -> Nameable | None:
    """Return which configurations the program of a job can name, None if nobody knows."""
    reader, robot = find_post(job.program.controller).reader, job.cell.robot
    return (
        None if reader is None else lambda q, margin: reader.nameable(q, robot, job.program, margin)
    )


def verify_motion(
    planned: Planned, watch: Watch | None = None, beside: Beside | None = None
) -> Proven | Refused:
    """Replay a planned motion in PyBullet, which shares no code with the planner.

    Args:
        planned: The motion.
        watch: Follows the run.
        beside: What may work beside this process, if anything.

    Returns:
        The verified motion; `Refused` if the replay finds anything wrong.

    Raises:
        Cancelled: If the run was cancelled.
    """
    watch, beside = watch or Watch(), beside or Beside()
    surfaced = planned.surfaced
    job = surfaced.job
    beside.begin_behind(planned.comparison)
    beside.begin_behind(planned.drawn)
    with watch.stage(Stage.VERIFICATION) as progress:
        verification = replay(
            job.cell,
            surfaced.points,
            planned.timed,
            job.search.max_contact_error,
            progress,
            beside,
        )
    if verification.verified is None:
        return Refused(planned, verification, (), watch.seconds)
    return Proven(planned, verification, verification.verified)


def write_program(proven: Proven, watch: Watch | None = None, beside: Beside | None = None) -> Run:
    """Write the program of a verified motion, and prove what its files say.

    The files are texts yet; `deliver` puts them into a folder.

    Args:
        proven: The motion.
        watch: Follows the run.
        beside: What may work beside this process, if anything.

    Returns:
        The program and its files; `Refused` if they do not say what was proven.

    Raises:
        OplError: If the program cannot be written for the controller.
        Cancelled: If the run was cancelled.
    """
    watch, motion, planned = watch or Watch(), proven.motion, proven.planned
    job, points = proven.surfaced.job, proven.surfaced.points
    stops: frozenset[int] = frozenset()
    while True:
        with watch.stage(Stage.EXPORT), keys_named(job.source):
            program, files = render_program(proven, stops)
        with watch.stage(Stage.READ_BACK):
            found = read_back(
                job, points, planned.exact, motion, program, files, planned.seen, beside
            )
        # in the air a corner that would come too near to something becomes a stop
        near = frozenset() if found is None else found.stops(program) - stops
        if not near:
            break
        stops |= near
    if found is not None and not found.proven:
        return Refused(proven, found, (), watch.seconds)
    with watch.stage(Stage.COMPARISON):
        planned.comparison.value()
    with watch.stage(Stage.EXPORT):
        files = {**files, **planned.charted.value().charts}
        planned.drawn.value()
    return Written(proven, program, files, found, watch.seconds)


def _without_path(prepared: Prepared, error: NoPathError, watch: Watch) -> Refused:
    """Return the refusal of a job without a path, with what would open one."""
    if isinstance(error, NoFreeMoveError):  # on the wheel nothing has to change
        return Refused(prepared, error, (), watch.seconds)
    surfaced = prepared.surfaced
    with watch.stage(Stage.REMEDIES) as progress:
        remedies = find_remedies(surfaced.job, surfaced.points, error.at_leads, progress)
    return Refused(prepared, error, remedies.found, watch.seconds, remedies.in_vain)
