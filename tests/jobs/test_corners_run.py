"""Levels too wide for the contact: what is chosen, what is refused, and what the bytes tell."""

import json
import re

import pytest
import yaml

from tests.jobs.test_verify import SHORT, refuses
from tests.support.jobs import opl, write_job

pytestmark = pytest.mark.usefixtures("no_pictures")

NARROW = [0.5, 25, 50, 100, 200, 300, 400, 500]  # of the position levels, in [mm]


def ratios(home, zones):
    """Write a file of the controller's parameters, with zones or without."""
    axes = [{"name": name, "per_degree": 1000.0 + n} for n, name in enumerate("SLURBT")]
    file = {"robot": "mh24", "source": "made up", "axes": axes}
    (home / "own.yaml").write_text(
        yaml.safe_dump({**file, **({"position_level_zones_mm": zones} if zones else {})})
    )


@pytest.fixture(scope="module")
def narrow(tmp_path_factory):
    """Return a folder with a job of narrow zones and its program in out/."""
    home = tmp_path_factory.mktemp("narrow")
    job = write_job(home, {**SHORT, "program.pulse_ratios": "own.yaml"}, quick=False)
    ratios(home, NARROW)
    ended = opl("run", job, "--out", home / "out")
    assert ended.status == 0, ended.err
    assert "whose zone nobody knows" not in ended.out
    return home


def verify(home, text=None, zones=NARROW):
    """Verify the program of narrow zones, or another text, for a controller with some zones."""
    ratios(home, zones)
    program = home / "tried" / "V_SHAPE.JBI"
    program.parent.mkdir(exist_ok=True)
    whole = (home / "out" / "V_SHAPE.JBI").read_bytes()
    program.write_bytes(whole if text is None else text.encode("ascii"))
    return opl("verify", home / "job.yaml", program, "--json")


def too_wide(ended):
    """Return the findings of corners: message, error and zone that would do, in [mm]."""
    told = json.loads(ended.out)
    assert ended.status == 4 and not told["proven"]
    found = []
    for one in told["findings"]:
        if one["kind"] == "corner":
            message = one["message"]
            error = float(re.search(r"ground point ([0-9.]+) mm", message)[1])
            found.append(
                (
                    one["where"],
                    message,
                    error,
                    float(re.search(r"of ([0-9.]+) mm would", message)[1]),
                )
            )
    return found


def test_a_program_for_narrow_zones_is_proven_for_them(narrow):
    corners = json.loads((narrow / "out" / "result.json").read_text())["verification"]["file"][
        "corners"
    ]
    assert corners["zones_unknown"] == 0 and corners["rounded"] > 20
    assert 0.0 < corners["max_contact_error_mm"] <= corners["allowed_contact_error_mm"] == 0.1
    ended = verify(narrow)
    assert ended.status == 0, ended.err
    assert json.loads(ended.out)["corners"] == corners


def test_zones_that_nobody_knows_are_too_wide_for_it(narrow):
    found = too_wide(verify(narrow, zones=None))
    for where, message, error, zone in found:
        assert where.startswith("pass 1, cutter point")
        assert "zone not known, half of each move taken" in message
        assert "0.1 mm allowed" in message and error > 0.1
        assert zone >= 0.5  # the level it was written for


def test_a_level_that_is_changed_in_the_file_is_found_with_both_numbers(narrow):
    where, _, worst, _ = too_wide(verify(narrow, zones=None))[0]
    label = re.search(r"(C\d{5})\)", where)[1]
    text = (narrow / "out" / "V_SHAPE.JBI").read_bytes().decode("ascii")
    text, n = re.subn(rf"(MOVJ {label} VJ=\S+) PL=1", r"\1 PL=8", text)
    assert n == 1
    ended = verify(narrow, text)
    assert refuses(
        opl("verify", narrow / "job.yaml", narrow / "tried" / "V_SHAPE.JBI"),
        "level at pass 1",
        "got PL=8",
    )
    ((place, message, error, _),) = too_wide(ended)
    assert place == where and error == worst
    assert message.startswith("PL=8 (zone 500 mm) leaves the ground point")


def test_wide_zones_are_chosen_for(narrow, tmp_path):
    """With the zones of a GP25 more positions are written, and all is proven."""
    job = write_job(tmp_path, {**SHORT, "program.pulse_ratios": "own.yaml"}, quick=False)
    ratios(tmp_path, [12.5, 25, 50, 100, 200, 300, 400, 500])
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    few, more = (
        json.loads((home / "out" / "result.json").read_text()) for home in (narrow, tmp_path)
    )
    assert few["program"]["moves"] < more["program"]["moves"]
    assert more["verification"]["file"]["corners"]["max_contact_error_mm"] <= 0.1


def moves(folder):
    """Return the moves of the written V program, word and corner each."""
    lines = (folder / "V_SHAPE.JBI").read_bytes().decode("ascii").split("\r\n")
    split = [line.split() for line in lines if line.startswith("MOV")]
    return [(words[0], words[3] if len(words) > 3 else "") for words in split]


def figures(corners):
    """Leave out the place: where between two cutter points it is, is recognised to a thousandth."""
    return {key: value for key, value in corners.items() if key != "max_contact_error_at"}


def corners_of(folder):
    found = json.loads((folder / "result.json").read_text())["verification"]["file"]["corners"]
    return figures(found)


def verified_corners(job, folder):
    ended = opl("verify", job, folder / "V_SHAPE.JBI", "--json")
    assert ended.status == 0, ended.err
    return figures(json.loads(ended.out)["corners"])


def test_without_a_level_half_of_each_move_is_taken_whatever_zones_are_known(narrow, tmp_path):
    levels = {"on_wheel": "none", "lead": "none", "free_move": 3}
    changes = {"program.pulse_ratios": "own.yaml", "program.position_levels": levels}
    job = write_job(tmp_path, {**SHORT, **changes}, quick=False)
    ratios(tmp_path, NARROW)
    assert opl("run", job, "--out", tmp_path / "out").status == 0
    written = moves(tmp_path / "out")
    stops = [(word, corner) for word, corner in written if corner]
    assert set(stops) == {("MOVJ", "PL=0")} and 4 <= len(stops) < len(written) - 20
    corners = corners_of(tmp_path / "out")
    assert corners["zones_unknown"] == corners["rounded"] > 20
    assert corners["max_contact_error_mm"] <= 0.1
    assert verified_corners(job, tmp_path / "out") == corners
    # half of each move needs more positions than zones of half a millimetre
    assert len(written) > len(moves(narrow / "out"))


def test_straight_moves_have_the_corner_radius_of_their_kind(tmp_path):
    changes = {"program.motion": "straight", "program.corner_radius_mm": {"on_wheel": 5}}
    job = write_job(tmp_path, {**SHORT, **changes}, quick=False)
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    written = moves(tmp_path / "out")
    assert set(written) == {
        ("MOVJ", "PL=0"), ("MOVL", "PL=0"), ("MOVL", "PL=1"), ("MOVL", "CR=5.0")
    }  # fmt: skip
    corners = corners_of(tmp_path / "out")
    # nobody knows the zones of the leads, those of radii everybody
    assert corners["zones_unknown"] == written.count(("MOVL", "PL=1"))
    assert corners["rounded"] == sum(corner != "PL=0" for _, corner in written)
    assert verified_corners(job, tmp_path / "out") == corners
    program = tmp_path / "out" / "V_SHAPE.JBI"
    text = program.read_bytes().decode("ascii")
    for other, kind in (("CR=5.1", "level"), ("PL=1", "level"), ("CR=5.0 PL=1", "program")):
        program.write_bytes(text.replace("CR=5.0", other, 1).encode("ascii"))
        ended = opl("verify", job, program, "--json")
        assert ended.status == 4
        found = [one for one in json.loads(ended.out)["findings"] if one["kind"] == kind]
        assert len(found) == 1 and (kind == "program" or "must be CR=5.0 at most" in str(found))
