"""What `python -m benchmarks` writes, and how it tells what became slower."""

import sys

from benchmarks.measuring import MICRO, SECOND, Row, Timing, timed, timed_process
from benchmarks.results import FILE, PLOT, write_results
from benchmarks.stranger_table import Outcome, page
from benchmarks.without import PARTS
from benchmarks.without import page as page_without


def row(name, seconds, unit=SECOND):
    return Row(name, unit, Timing(seconds, seconds, seconds, seconds))


def test_what_became_slower_than_in_the_results_before_is_named(tmp_path):
    first = [row("a run", 2.0), row("a pose", 3e-6, MICRO), row("another", 1.0)]
    assert write_results(tmp_path, first, {"a run": {"search": 1.0, "total": 2.0}}, {}) == []
    text = (tmp_path / FILE).read_text(encoding="utf-8")
    assert "| a run | 50 |" in text and "| a pose | 3 us |" in text
    second = [row("a run", 2.2), row("a pose", 6e-6, MICRO), row("new", 9.0)]
    slower = write_results(tmp_path, second, {}, {100: second[0].ours, 300: second[2].ours})
    assert slower == ["slower than before: a pose, 2.00 times"]
    assert slower[0] in (tmp_path / FILE).read_text(encoding="utf-8")
    assert (tmp_path / PLOT).read_text(encoding="utf-8").startswith("<?xml")


def test_a_process_that_fails_or_takes_too_long_has_no_time():
    assert timed_process([sys.executable, "-c", "import sys; sys.exit(3)"], 1, 60.0) is None
    assert timed_process([sys.executable, "-c", "import time; time.sleep(60)"], 1, 0.2) is None
    found = timed_process([sys.executable, "-c", "x = bytearray(80_000_000)"], 1, 60.0)
    assert found.least <= found.median <= found.most and found.memory > 80_000_000


def test_a_process_finds_its_modules_compiled(monkeypatch):
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    script = "import sys; sys.exit(sys.dont_write_bytecode)"
    assert timed_process([sys.executable, "-c", script], 1, 60.0) is not None


def test_a_time_is_that_of_one_of_what_is_counted():
    calls = []
    found = timed(lambda: calls.append(sum(range(20_000))), 3, count=10)
    assert len(calls) == 4 and found.least <= found.median <= found.most


def stranger(index, status, **facts):
    return Outcome(index, 0, status, "cone", "mh12", "upright", **facts)


def test_a_page_of_strangers_counts_what_is_closed_and_what_has_no_bound():
    outcomes = [
        stranger(0, "ok", found=1.0, bound=0.999, search_s=3.0),
        stranger(1, "ok", found=1.0, bound=0.999, search_s=12.0),
        stranger(2, "ok", found=1.0, bound=0.99, search_s=2.0, cause="a wall | too few"),
        stranger(3, "not found", search_s=25.0, cause="no path found"),
        stranger(5, "not found", search_s=9.0, bound=0.5, cause="no path found, none below 0.5"),
        stranger(4, "no_path", search_s=31.0, cause="no path: shut\nat cutter point 3"),
    ]
    text = page(7, outcomes)
    assert "5 jobs searched: 2 with a gap of at most 0.2 %, 1 of them within 10 s" in text
    assert "half of the gaps are below 0.10 %, 95 of 100 below 0.91 %, all below 1.00 %" in text
    assert "Found: joint travel on the wheel in rad." in page(7, outcomes, "travel")
    assert "--seed 7 --objective travel`" in page(7, outcomes, "travel")
    assert "--seed 7 --families channel step`" in page(7, outcomes, families=["channel", "step"])
    assert "--seed 7 --uncommon`" in page(7, outcomes, uncommon=True)
    assert (
        "2 without a path, 1 without a bound; slowest 31.0 s of all drawn. Drawn again: 1 no_path."
        in text
    )
    assert "| 2.0 | cone | mh12 | upright | 0 in 0 | ok | no | 1.000 % |" in text
    assert "a wall / too few |" in text and "cutter point 3" not in text


def test_what_is_left_out_of_the_proof_is_there():
    for part in PARTS.values():
        assert part.lines > 0
        for owner, attribute, other in part.instead:
            assert callable(getattr(owner, attribute)) and callable(other)


def test_a_page_without_a_part_counts_what_was_closed_or_proven_impossible_with_everything():
    def outcomes(*gaps):
        found = {}
        for index, gap in enumerate(gaps):
            facts = {"status": gap} if isinstance(gap, str) else {"found": 1.0, "bound": 1.0 - gap}
            status = facts.pop("status", "ok")
            found[index, 0] = stranger(index, status, processor_s=2.0, **facts)
        return found

    everything = outcomes(0.0, 0.001, 0.0, 0.3, "no_path", "no_path")
    without = outcomes(0.0, "not found", 0.05, 0.0, "not found", "no_path")
    text = page_without(7, "abc1234", {"nothing": everything, "hope": without})
    assert "at abc1234. Of the 5 random jobs" in text
    assert "| nothing | - | 3 | 2 | 0 | - | 10 | - |" in text
    assert f"| {PARTS['hope'].lines} | 1 | 1 | 2 | 5.0 % | 10 | 1.0, 2.0, 4.0 |" in text
