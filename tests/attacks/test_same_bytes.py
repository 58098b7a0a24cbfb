"""The same job gives the same bytes, whatever else the machine does."""

from tests.attacks.same_bytes import differences
from tests.support.jobs import write_job


def test_no_condition_changes_a_byte(tmp_path):
    job = write_job(tmp_path / "job")
    assert differences(job, tmp_path, stop=8.0) == []
