"""The plug-in as it is copied: whole, readable by the Python of older FreeCADs."""

import ast
import xml.etree.ElementTree as ElementTree

from opl.files.resources import install_plugin
from tests.support.jobs import opl


def test_the_workbench_is_copied_whole_and_an_older_one_replaced(tmp_path):
    ended = opl("plugin", tmp_path)
    assert ended.status == 0 and str(tmp_path / "opl") in ended.out
    (tmp_path / "opl" / "opl_workbench" / "of_last_year.py").write_text("")
    made = install_plugin(tmp_path)
    names = {path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file()}
    assert {"package.xml", "Init.py", "InitGui.py", "opl_workbench/client.py"} <= names
    assert "opl_workbench/of_last_year.py" not in names
    assert not [name for name in names if name.endswith(".pyc")]


def test_what_is_not_the_workbench_is_left_alone(tmp_path):
    (tmp_path / "opl").mkdir()
    (tmp_path / "opl" / "mine.txt").write_text("mine")
    ended = opl("plugin", tmp_path)
    assert ended.status == 2 and "is not the workbench of opl" in ended.err
    assert (tmp_path / "opl" / "mine.txt").read_text() == "mine"
    ended = opl("plugin", tmp_path / "nowhere")
    assert ended.status == 2 and "name the folder Mod" in ended.err


def test_what_the_add_on_manager_reads_is_there(tmp_path):
    made = install_plugin(tmp_path)
    space = "{https://wiki.freecad.org/Package_Metadata}"
    workbench = ElementTree.parse(made / "package.xml").getroot().find(f".//{space}workbench")
    assert (made / workbench.find(f"{space}icon").text).is_file()
    classes = {
        node.name
        for node in ast.walk(ast.parse((made / "InitGui.py").read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    }
    assert workbench.find(f"{space}classname").text in classes


def test_pythons_of_older_freecads_read_every_file(tmp_path):
    for path in install_plugin(tmp_path).rglob("*.py"):
        ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 8))
