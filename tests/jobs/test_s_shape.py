"""The S part of the paper: contact fixed it cannot be ground, with the contact free it can."""

import json
import re
import shutil

import numpy as np
import yaml

from opl.files.resources import folder
from opl.job.load import load_job
from opl.planning.fixed_contact import keep_contact
from tests.support.jobs import opl
from tests.support.planned import problem_of, with_positions

S_SHAPE = folder("workpieces") / "s_shape"
TABLE_5 = [0.1099, 0.2345, 0.2446, 0.9062, 0.7344, 0.2375]  # of the paper


def test_contact_fixed_it_is_refused_at_more_than_half_of_its_points_which_are_named():
    problem = problem_of(with_positions(load_job(S_SHAPE / "job.yaml"), 3))
    fixed = keep_contact(problem)
    assert not fixed.feasible
    told = re.fullmatch(
        r"part cuts into wheel at (\d+) of (\d+) cutter points \((.+)\), \S+ mm deep at most",
        fixed.reason,
    )
    cut, count, named = told.groups()
    assert int(count) == len(problem.points) and int(cut) > 0.5 * int(count)
    runs = [[int(end) for end in run.split("-")] for run in named.split(", ")]
    assert sum(run[-1] - run[0] + 1 for run in runs) == int(cut)
    # the part is the paper's: in the middle row its joints do what the paper prints
    middle = np.ptp(fixed.q[problem.points.pass_index == 2], axis=0)
    np.testing.assert_allclose(middle, TABLE_5, atol=3e-3)


def test_with_the_contact_free_it_is_ground_verified_and_calmer_than_the_paper(tmp_path):
    shutil.copytree(S_SHAPE, tmp_path / "part")
    job = tmp_path / "part" / "job.yaml"
    content = yaml.safe_load(job.read_text())
    # five rows with all their points take a minute
    content["passes"].update(rows=1, max_chord_error_mm=0.08, max_step_mm=10)
    content["search"].update(method="recursive", contact_positions=45)
    job.write_text(yaml.safe_dump(content))
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    told = json.loads((tmp_path / "out" / "result.json").read_text())
    assert told["path"]["joint_range_sum_rad"] <= sum(TABLE_5)
    assert told["verification"]["collisions"] == 0
    assert not told["fixed"]["feasible"]
    assert (tmp_path / "out" / "S_SHAPE.JBI").exists()
