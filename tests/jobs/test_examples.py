"""The examples: each runs alone, on the front door only, and prints what it promises."""

import ast
import runpy
import sys
from pathlib import Path

import pytest

import opl

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


def run(number, monkeypatch, *arguments):
    """Run an example as its user does, in this process."""
    (path,) = (path for path in EXAMPLES if path.name.startswith(number))
    monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
    runpy.run_path(str(path), run_name="__main__")


def test_from_yaml_to_a_program(tmp_path, monkeypatch, capsys):
    run("01", monkeypatch, tmp_path)
    out = capsys.readouterr().out
    assert "program FIRST for Motoman MH24" in out and "  verification: 100 %\n" in out
    assert out.endswith(f"{tmp_path / 'program' / 'FIRST.JBI'}: proven\n")
    assert (tmp_path / "program" / "result.json").is_file()


def test_one_job_on_three_robots(tmp_path, monkeypatch, capsys):
    run("02", monkeypatch, tmp_path)
    heading, *rows = capsys.readouterr().out.splitlines()
    assert heading.split()[0] == "robot"
    assert [row.split()[0] for row in rows] == ["mh24", "gp25", "ar2010"]
    for row in rows:
        range_sum, travel, cycle, clearance = map(float, row.split()[1:])
        assert 0.0 < range_sum <= travel and cycle > 0.0 and clearance >= 5.0
        assert (tmp_path / row.split()[0] / "COMPARED.JBI").is_file()


def test_a_surface_made_in_python(monkeypatch, capsys):
    run("03", monkeypatch)
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first.endswith("cutter points in 3 passes, proven:")
    assert second == "/JOB"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_uses_the_front_door_only(path):
    text = path.read_text(encoding="utf-8")
    assert 60 <= len(text.splitlines()) <= 90
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {node.module}
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "opl":
            assert node.attr in opl.__all__
            continue
        else:
            continue
        assert names <= {*sys.stdlib_module_names, "numpy", "opl"}
