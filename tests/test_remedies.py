"""Why not, and what would help: changes that open an impossible job are planned again."""

import json

from jobs import opl, write_trough


def test_a_narrower_wheel_opens_a_trough_and_is_told(tmp_path):
    # 30 mm wide, 15 mm deep: the flat of 50 mm cannot get in, a narrower one can
    job = write_trough(tmp_path / "t", width_mm=44.0, depth_mm=1.5)
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 3
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["status"] == "no_path"
    assert result["remedies"], result["reasons"]
    for remedy in result["remedies"]:
        assert remedy.startswith("would be possible with ")
        assert remedy in ended.err
