"""The same job gives the same bytes, whatever else the machine does."""

from tests.attacks.same_bytes import differences
from tests.support.jobs import write_job


def test_no_condition_changes_a_byte(tmp_path):
    assert differences(write_job(tmp_path / "job"), tmp_path, pause=5.0) == []
