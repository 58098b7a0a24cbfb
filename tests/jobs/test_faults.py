"""Faults put into a written program, or into the cell it is proven against, on the V and S parts.

Each must be refused, with its place and its cause named. The programs are short: the middle of two
rows, from a home near the wheel.
"""

import csv
import json
import re
import shutil
from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial import KDTree

from opl.cell.collision import CollisionScene
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.files.resources import folder
from opl.geometry.frames import transform
from opl.geometry.mesh import TriangleMesh
from opl.geometry.toolpath import CutterPoints
from opl.job.load import load_job
from opl.job.values import Job
from opl.program.pulses import PulseScale
from opl.proof.prove import prove, reader_of
from opl.run.surfacing import cut_surface
from tests.support.bare_cells import with_obstacle
from tests.support.corners import needed
from tests.support.jobs import opl

pytestmark = pytest.mark.usefixtures("no_pictures")

# what is left out at both ends of a row, and a home near the wheel
PARTS = {
    "v_shape": {"end_margin_mm": 75, "home_deg": [20, -30, -55, -5, 48, 120]},
    "s_shape": {"end_margin_mm": 40, "home_deg": [25, -20, -66, 84, -85, -69]},
}


@dataclass(frozen=True, eq=False)
class Written:
    """A program as opl run wrote it.

    Attributes:
        job: Its job.
        points: The cutter points of the job.
        file: The program, with result.json beside it.
        places: Of each written configuration the cutter point, fractional; NaN off the wheel.
    """

    job: Job
    points: CutterPoints
    file: object
    places: np.ndarray

    @property
    def last(self):
        """Return the number of the last configuration."""
        return len(self.places) - 1

    @property
    def ground(self):
        """Return the numbers of the configurations on the wheel."""
        return np.flatnonzero(~np.isnan(self.places))

    def of_pass(self, index):
        """Return the numbers of those of a pass."""
        of = self.points.pass_index[self.places[self.ground].astype(int)]
        return self.ground[of == index]

    @property
    def needed(self):
        """Return the number of the configuration of the first pass that is needed most."""
        q = np.array([Text(self).angles(number) for number in range(self.last + 1)])
        return needed(q, self.of_pass(0)[1:-2])

    @property
    def middle(self):
        """Return the number of the configuration in the middle of the first pass."""
        numbers = self.of_pass(0)
        return int(numbers[len(numbers) // 2])


@pytest.fixture(scope="module", params=PARTS)
def written(request, tmp_path_factory):
    """Plan and write the short program of a part."""
    home = tmp_path_factory.mktemp("faults") / request.param
    shutil.copytree(folder("workpieces") / request.param, home)
    content = yaml.safe_load((home / "job.yaml").read_text())
    own = PARTS[request.param]
    content["passes"].update(
        rows=2, max_step_mm=12, max_chord_error_mm=0.09, end_margin_mm=own["end_margin_mm"]
    )
    content["search"].update(method="recursive", contact_positions=45)
    content["process"].update(approach_mm=20, home_deg=own["home_deg"])
    (home / "job.yaml").write_text(yaml.safe_dump(content))
    ended = opl("run", home / "job.yaml", "--out", home / "out")
    assert ended.status == 0, ended.err
    job = load_job(home / "job.yaml")
    points = cut_surface(job).points
    lines = (home / "out" / f"{job.name}.csv").read_text().splitlines()
    rows = [row for row in csv.DictReader(lines) if row["speed"]]
    places = np.array([float(row["cutter_point"] or "nan") for row in rows])
    return Written(job, points, home / "out" / f"{job.name}.JBI", places)


class Text:
    """A program that is tampered with; configurations are told by their numbers."""

    def __init__(self, written):
        self.text = written.file.read_bytes().decode("ascii")
        self.scale = PulseScale.of(written.job.cell.robot)

    def pulses(self, number):
        return [int(v) for v in re.search(rf"C{number:05d}=(.*)\r", self.text)[1].split(",")]

    def angles(self, number):
        return self.scale.to_angles(np.array(self.pulses(number)))

    def put(self, number, pulses):
        told = ",".join(str(int(v)) for v in pulses)
        return self.replace(rf"C{number:05d}=.*\r", f"C{number:05d}={told}\r")

    def replace(self, pattern, by):
        self.text, n = re.subn(pattern, by, self.text)
        assert n == 1, f"{n} times {pattern}"
        return self

    def place(self, number):
        """Return where a message says that the move to a configuration is."""
        before = self.text[: self.text.index(f"C{number:05d} ")]
        return f"line {before.count(chr(10)) + 1}"

    def reorder(self, numbers):
        """Leave these configurations and their moves, in this order, numbered anew."""
        configurations = dict(re.findall(r"C(\d{5})=(.*)\r\n", self.text))
        moves = dict(re.findall(r"MOV[JL] C(\d{5}) (.*)\r\n", self.text))
        head, foot = self.text.split("C00000=")[0], self.text.split("MOVJ C00000 ")[0]
        between = foot[foot.rindex(configurations[max(configurations)]) :].split("\r\n", 1)[1]
        told = [f"{number:05d}" for number in numbers]
        self.text = (
            re.sub(r"NPOS \d+,", f"NPOS {len(told)},", head)
            + "".join(f"C{k:05d}={configurations[number]}\r\n" for k, number in enumerate(told))
            + between
            + "".join(f"MOVJ C{k:05d} {moves[number]}\r\n" for k, number in enumerate(told))
            + "END\r\n"
        )
        return self


def proof_of(written, text=None, job=None):
    content = written.file.read_bytes() if text is None else text.text.encode("ascii")
    return prove(job or written.job, written.points, {written.file.name: content})


def in_cell(written, **changes):
    """Return the job of a program with its cell changed."""
    return replace(written.job, cell=replace(written.job.cell, **changes))


def refuses(proof, *words):
    """Assert that a program is not proven for a reason that holds these words."""
    assert not proof.proven
    told = [str(finding) for finding in proof.findings]
    assert any(all(word in line for word in words) for line in told), told
    return True


def test_the_unharmed_program_is_proven(written):
    ended = opl("verify", written.job.source.label, written.file, "--json")
    assert ended.status == 0, ended.err
    told = json.loads(ended.out)
    assert told["proven"] is True and told["as_written"] is True
    # nor does it harm to write it anew as the faults below do
    proof = proof_of(written, Text(written).reorder(range(written.last + 1)))
    assert proof.proven and proof.findings == ()
    assert proof.ground == len(written.points) > 12
    assert np.ptp(written.points.pass_index) == 1


def test_one_pulse_more_is_found_beside_the_result_of_the_run(written, tmp_path):
    for file in (written.file, written.file.parent / "result.json"):
        shutil.copy(file, tmp_path)
    number, text = written.middle, Text(written)
    pulses = text.pulses(number)
    pulses[4] += 1
    (tmp_path / written.file.name).write_bytes(text.put(number, pulses).text.encode("ascii"))
    ended = opl("verify", written.job.source.label, tmp_path / written.file.name)
    assert ended.status == 4
    assert "file at" in ended.err and written.file.name in ended.err
    assert "not the bytes that opl run proved" in ended.err


def test_a_few_hundred_pulses_more_are_found(written):
    text, number = Text(written), written.middle
    pulses = text.pulses(number)
    pulses[4] += 200
    proof = proof_of(written, text.put(number, pulses))
    assert refuses(proof, "contact at pass 1, cutter point")


def test_a_swapped_wrist_in_the_middle_is_found(written):
    text, number, robot = Text(written), written.middle, written.job.cell.robot
    q = text.angles(number)
    slots = inverse_kinematics(robot.arm, forward_kinematics(robot, q), q)
    here = int(np.abs(np.remainder(slots - q + np.pi, 2 * np.pi) - np.pi).max(axis=1).argmin())
    other = slots[(here + 4) % 8]  # the same pose, the wrist flipped
    proof = proof_of(written, text.put(number, text.scale.to_pulses(other)))
    assert refuses(proof, "contact at pass 1, cutter point", "wheel's surface")


def test_two_points_exchanged_are_found(written):
    # hundredths of a millimetre apart, where the contact pivots, the two would grind the same
    apart = np.diff(written.places[written.of_pass(0)])
    one = int(written.of_pass(0)[apart.argmax()])
    text, other = Text(written), one + 1
    first, second = text.pulses(one), text.pulses(other)
    proof = proof_of(written, text.put(one, second).put(other, first))
    assert refuses(proof, "contact at pass 1, cutter point")


def test_points_in_the_place_of_the_one_before_are_found(written):
    text, other = Text(written), written.needed
    # one alone may be there for the speed, or for the corners
    text = text.put(other, text.pulses(other - 1)).put(other + 1, text.pulses(other - 1))
    assert refuses(proof_of(written, text), "at pass 1, cutter point")


def test_a_point_ground_twice_is_found(written):
    one, other = written.middle, written.middle + 1
    twice = [*range(other + 1), *range(other, one - 1, -1), *range(one, written.last + 1)]
    proof = proof_of(written, Text(written).reorder(twice))
    assert refuses(proof, "pass 1", "cutter point")


def test_a_missing_point_is_found(written):
    rest = [k for k in range(written.last + 1) if k != written.needed]
    proof = proof_of(written, Text(written).reorder(rest))
    # off the contact on the long move, or where its corners are rounded
    assert refuses(proof, "at pass 1, cutter point")


def test_a_dropped_pass_is_found(written):
    first = int(written.points.pass_index.searchsorted(1))
    last_of_one, last_of_two = (int(written.of_pass(index)[-1]) for index in (0, 1))
    # away from the end of the first pass as from the end of the second: the ends of both retracts
    retract = range(last_of_one + 1, last_of_one + 1 + written.last - 1 - last_of_two)
    left = [*range(last_of_one + 1), *retract, written.last]
    proof = proof_of(written, Text(written).reorder(left))
    assert proof.ground == first
    assert refuses(proof, f"order at cutter point {first}:")


def test_full_speed_to_the_wheel_and_on_it_is_found(written):
    text = Text(written)
    to_it, on_it = int(written.ground[0]) - 2, written.middle
    for number in (to_it, on_it):
        text.replace(rf"(C{number:05d}) VJ=[0-9.]+", r"\1 VJ=100.00")
    proof = proof_of(written, text)
    assert refuses(proof, "speed at approach of pass 1", text.place(to_it), "times the speed")
    assert refuses(proof, "speed at pass 1, cutter point", text.place(on_it), "times the feed")


def test_a_wheel_shifted_by_a_millimetre_is_found(written):
    wheel = written.job.cell.wheel
    T = wheel.T_base_contact0.copy()
    T[:3, 3] -= 1e-3 * T[:3, 2]  # towards the part
    proof = proof_of(written, job=in_cell(written, wheel=replace(wheel, T_base_contact0=T)))
    assert proof.ground == 0
    assert refuses(proof, "order at cutter point 0:")
    assert refuses(proof, "collision at", "part and wheel", "into each other")


def test_a_part_two_millimetres_too_big_is_found(written):
    part = written.job.cell.part
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    larger = TriangleMesh(part.vertices + 2e-3 * np.asarray(mesh.vertex_normals), part.faces)
    proof = proof_of(written, job=in_cell(written, part=larger))
    for place in ("pass 1, cutter point", "pass 2, cutter point"):
        assert refuses(proof, f"collision at {place}", "part and wheel", "into each other")


def test_a_limit_that_cuts_the_farthest_configuration_is_found(written):
    text, robot = Text(written), written.job.cell.robot
    q = np.array([text.angles(number) for number in written.ground])
    upper = robot.upper.copy()
    upper[0] = q[:, 0].max() - np.deg2rad(0.02)
    job = in_cell(written, robot=replace(robot, upper=upper))
    proof = proof_of(written, job=job)
    assert refuses(proof, "limit at", "joint S", "beyond its limit")
    assert refuses(proof, "cutter point", "joint S", "0.020 deg beyond its limit")


@pytest.mark.parametrize("written", ["s_shape"], indirect=True)  # the V has one in test_verify.py
def test_a_limit_crossed_between_two_configurations_is_found(written):
    """On a straight move a joint can go beyond what both ends have; on a joint move none can."""
    text = Text(written).replace(r"MOVJ (C00001) VJ=\S+", r"MOVL \1 V=50.0")
    robot = written.job.cell.robot
    files = {"a": text.text.encode("ascii")}
    playback = reader_of(written.job).read(files, robot, written.job.program).playback
    end = int(playback.stations[1])
    rest = np.concatenate([playback.q[:1], playback.q[end:]])
    above = playback.q[:end].max(axis=0) - rest.max(axis=0)
    below = rest.min(axis=0) - playback.q[:end].min(axis=0)
    lower, upper = robot.lower.copy(), robot.upper.copy()
    joint = int(np.maximum(above, below).argmax())
    assert max(above[joint], below[joint]) > np.deg2rad(0.02)
    if above[joint] > below[joint]:
        upper[joint] = rest.max(axis=0)[joint] + above[joint] / 2.0
    else:
        lower[joint] = rest.min(axis=0)[joint] - below[joint] / 2.0
    narrow = in_cell(written, robot=replace(robot, lower=lower, upper=upper))
    # as it was written, joint moves between the same configurations, it stays within
    q = np.array([Text(written).angles(number) for number in range(written.last + 1)])
    assert (q > lower).all() and (q < upper).all()
    proof = proof_of(written, text, narrow)
    name = robot.joint_names[joint]
    assert refuses(proof, "limit at free move from home", f"joint {name}", "beyond its limit")


def test_a_collision_only_between_two_configurations_is_found(written):
    text, cell = Text(written), written.job.cell
    q = np.array([text.angles(number) for number in range(written.last + 1)])

    def corners(configurations):
        Ts = forward_kinematics(cell.robot, configurations) @ cell.T_flange_workpiece
        return transform(Ts[:, None], cell.part.vertices)

    # the corner that, half-way, is farthest from all corners at the written configurations
    half_way = corners(q[:2].mean(axis=0)[None])[0]
    distance, _ = KDTree(corners(q).reshape(-1, 3)).query(half_way)
    narrow = with_obstacle(cell, half_way[distance.argmax()], (2e-3, 2e-3, 2e-3), "pin")
    assert not CollisionScene(narrow).collides(q).any()
    proof = proof_of(written, job=replace(written.job, cell=narrow))
    assert refuses(proof, "collision at free move from home", "part and pin", "into each other")
    assert {finding.where for finding in proof.findings} <= {
        "free move from home",
        "free move to home",
    }
