import csv
import io

import numpy as np
import pytest

from opl.errors import InputError
from opl.geometry.frames import pose
from opl.program.inform import parse, write_jobs
from opl.program.moves import plan_moves
from opl.program.profiles import DX200
from opl.program.settings import ProgramSettings
from opl.program.table import render_table
from tests.support.program_samples import (
    DATE,
    JOINT_NAMES,
    MAX_SPEED,
    ROBOT,
    SCALE,
    verified_motion,
)


def flange_poses(n):
    """Poses with the flange's z down, turned a little more each time."""
    turn = np.linspace(0.0, 0.5, n)
    c, s, o = np.cos(turn), np.sin(turn), np.zeros(n)
    R = np.stack([c, s, o, s, -c, o, o, o, o - 1.0], axis=-1).reshape(n, 3, 3)
    return pose(R, np.stack([1.2 - 0.01 * turn, -1e-9 + o, 0.4 + turn], axis=-1))


def written():
    program = plan_moves(verified_motion(), "SAMPLE", MAX_SPEED)
    return write_jobs(program, ROBOT, ProgramSettings(), DX200, DATE)


def table(**options):
    verified = verified_motion()
    poses = flange_poses(len(verified.motion))
    return render_table(verified, written(), SCALE, poses, **options)


def rows():
    return list(csv.DictReader(io.StringIO(table())))


def test_table_is_the_golden_one(assert_golden):
    assert_golden("SAMPLE.csv", table())


def test_every_configuration_has_a_row_and_every_row_every_column():
    assert len(rows()) == len(verified_motion().motion)
    assert all(None not in row and None not in row.values() for row in rows())
    assert {row["kind"] for row in rows()} == {
        "home", "link", "approach", "grind", "between", "retract"
    }  # fmt: skip


def test_pulses_and_speeds_are_those_of_the_job():
    job = parse(written().files["SAMPLE.JBI"])
    of_moves = [row for row in rows() if row["speed"]]
    assert len(of_moves) == len(job.positions) == len(rows()) - 2
    for row, position, move in zip(of_moves, job.positions, job.moves, strict=True):
        assert [float(row[f"{name}_pulses"]) for name in JOINT_NAMES] == list(position.values)
        assert row["speed"] == f"VJ={move.tag('VJ')}"


def test_angles_lengths_and_times_are_in_the_units_of_their_columns():
    timed, poses = verified_motion().timed, flange_poses(len(rows()))
    for i, row in enumerate(rows()):
        angles = [float(row[f"{name}_deg"]) for name in JOINT_NAMES]
        np.testing.assert_allclose(angles, np.rad2deg(timed.motion.q[i]), atol=5.1e-5)
        origin = [float(row[f"{axis}_mm"]) for axis in "xyz"]
        np.testing.assert_allclose(origin, 1e3 * poses[i, :3, 3], atol=5.1e-4)
        assert float(row["time_s"]) == pytest.approx(timed.duration[i], abs=5.1e-5)
    assert rows()[0]["rx_deg"] == "180.0000"


def test_undefined_cells_are_empty_and_zeros_have_no_sign():
    first = rows()[0]
    assert first["pass"] == first["t"] == first["cutter_point"] == ""
    assert first["programmed_s"] == "" and all(row["clearance_mm"] for row in rows())
    assert first["y_mm"] == "0.000"
    assert "-0.000," not in table() and "-0.0000," not in table() and "nan" not in table()


def test_passes_count_from_one_as_in_the_job():
    assert {row["pass"] for row in rows()} == {"", "1", "2"}


def test_own_template_may_choose_columns(tmp_path):
    own = tmp_path / "own.csv.j2"
    own.write_text('{% for row in rows %}\n{{ row["pass"] }};{{ row["x_mm"] }}\n{% endfor %}\n')
    assert table(template=own).splitlines()[1].startswith("1;1199.")


def test_own_template_that_asks_for_an_unknown_column_is_refused(tmp_path):
    own = tmp_path / "own.csv.j2"
    own.write_text('{% for row in rows %}{{ row["speed_mm_s"] }}{% endfor %}')
    with pytest.raises(InputError, match=r"own.csv.j2: .*speed_mm_s"):
        table(template=own)
