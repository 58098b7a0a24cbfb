"""Levels too wide for the contact: what is chosen, what is refused, and what the bytes tell."""

import json
import re

import pytest
import yaml

from tests.jobs.test_verify import SHORT, refuses
from tests.support.jobs import opl, write_job

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
