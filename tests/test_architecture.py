"""How the package is built: imports run one way, heavy libraries live in one place each."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

import opl

PACKAGE = Path(opl.__file__).parent

# Lowest first. A module may import from floors below its own, and from its own room. Rooms on one
# floor do not know each other. A room is a folder, or a module that lies in the package itself.
FLOORS = [
    {"errors", "findings", "processor", "version"},
    {"files", "client", "plugins"},
    {"geometry", "store"},
    {"cell", "search"},
    {"motion"},
    {"planning", "verification", "program", "report"},
    {"walls"},
    {"least"},
    {"job"},
    {"proof"},
    {"run"},
    {"work"},
    {"service"},
    {"__init__"},
    {"cli"},
]

ROOMS = set().union(*FLOORS)

# where a library may be imported: rooms, or single modules
HOMES = {
    "pinocchio": {"cell"},
    "coal": {"cell"},
    "hppfcl": set(),
    "fcl": set(),  # the tests' own second scene
    "pybullet": {"verification"},
    "pybullet_utils": {"verification"},
    "pybullet_data": set(),
    "jinja2": {"program"},
    "yaml": {"files/yaml_text"},
    "click": {"cli"},
    "rich": {"cli"},
    "matplotlib": {"report"},
    "trimesh": {"geometry/mesh_file"},
    "contourpy": {"geometry/section_curves"},
    "OCP": {"geometry/cad"},
    "xacro": {"cell/xacro_file"},
    "toppra": {"motion/engine"},
    "ompl": {"motion/sampling"},
    "fastapi": {"service"},
    "starlette": {"service"},
    "uvicorn": {"service"},
    "distributed": {"work/cluster"},
    "sqlite3": {"store"},
    "numba": {"files/kernels", "files/kept_kernels"},
}

# rooms that run inside of other programs, with Python's own library and what the host has
GUESTS = {"plugins"}
HOSTS = {"FreeCAD", "FreeCADGui", "Part", "PySide", "pivy"}

LONGEST = 300  # lines


def modules_of(package):
    """Return {dotted name below the package: path}; a folder is named as its __init__."""
    return {
        ".".join(path.relative_to(package).with_suffix("").parts): path
        for path in sorted(package.rglob("*.py"))
    }


@cache
def all_imports(package):
    """Return {name: (own modules, other libraries)} that all modules of a package import."""
    known = modules_of(package)
    return {name: imports_of(package, known, name, path) for name, path in known.items()}


def imports_of(package, known, name, path):
    """Return (own modules, other libraries) that a module imports anywhere in its text."""
    own, others = set(), set()

    def note(parts):
        if parts[0] != package.name:
            others.add(parts[0])
            return
        # the longest part of a dotted name that is a module; the rest is what is taken from it
        for end in range(len(parts), 0, -1):
            inner = parts[1:end]
            for candidate in (".".join(inner), ".".join([*inner, "__init__"])):
                if candidate in known:
                    own.add(candidate)
                    return

    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            for alias in node.names:
                note(alias.name.split("."))
        elif isinstance(node, ast.ImportFrom):
            here = [package.name, *name.split(".")]
            start = here[: len(here) - node.level] if node.level else []
            module = [*start, *(node.module.split(".") if node.module else [])]
            for alias in node.names:
                note([*module, alias.name])
    return own - {name}, others


def room_of(name):
    return name.split(".")[0]


def floor_of(name):
    for number, rooms in enumerate(FLOORS):
        if room_of(name) in rooms:
            return number
    return None


def wrong_imports(package):
    """Return what is wrong with the imports of a package, one line each."""
    found = []
    for name, (own, others) in all_imports(package).items():
        if floor_of(name) is None:
            found.append(f"{name} is on no floor")
            continue
        for other in sorted(own):
            below = floor_of(other) is not None and floor_of(other) < floor_of(name)
            if room_of(other) != room_of(name) and not below:
                found.append(f"{name} imports {other}")
        # the model of a document stands beside what is made from it, on the rules of one module
        homes = {"files.documents", "files.quantities"}
        if "pydantic" in others and name not in homes and "files.documents" not in own:
            found.append(f"{name} imports pydantic, not files.documents")
        for library in sorted(others & HOMES.keys()):
            if not {room_of(name), name.replace(".", "/")} & HOMES[library]:
                found.append(f"{name} imports {library}")
    return found


def cycles(package):
    """Return modules that import each other in a circle, each circle once."""
    graph = {name: own for name, (own, _) in all_imports(package).items()}
    found, done = [], set()

    def visit(name, trail):
        if name in trail:
            circle = trail[trail.index(name) :]
            if not any(set(circle) == set(other) for other in found):
                found.append(circle)
            return
        if name not in done:
            for other in sorted(graph[name]):
                visit(other, [*trail, name])
            done.add(name)

    for name in graph:
        visit(name, [])
    return found


def too_long(package):
    lengths = {
        name: len(path.read_text().splitlines()) for name, path in modules_of(package).items()
    }
    return sorted(name for name, length in lengths.items() if length > LONGEST)


def with_leftovers(package):
    mark = re.compile(r"\b(TODO|FIXME|XXX)\b")
    return sorted(
        name for name, path in modules_of(package).items() if mark.search(path.read_text())
    )


def without_docstring(package):
    return sorted(
        name
        for name, path in modules_of(package).items()
        if not ast.get_docstring(ast.parse(path.read_text()))
    )


def importable(name):
    module = ".".join([PACKAGE.name, *(part for part in name.split(".") if part != "__init__")])
    return importlib.import_module(module)


# the package


def test_imports_run_one_way_and_heavy_libraries_stay_at_home():
    assert wrong_imports(PACKAGE) == []


def test_no_modules_import_each_other_in_a_circle():
    assert cycles(PACKAGE) == []


def test_every_module_has_one_screenful_of_concept():
    assert too_long(PACKAGE) == []


def test_nothing_is_left_to_be_done():
    assert with_leftovers(PACKAGE) == []


def test_the_map_has_the_same_floors_and_every_module():
    text = (PACKAGE.parent / "ARCHITECTURE.md").read_text()
    rows = re.findall(r"^\| (\d+) \| (.*?) \|", text, re.MULTILINE)
    mapped = [set() for _ in FLOORS]
    for number, rooms in rows:
        names = re.findall(r"`([a-z_]+)(?:/|\.py)`", rooms)
        mapped[int(number) - 1] |= {name for name in names if name in ROOMS}
    assert mapped == FLOORS
    named = set(re.findall(r"`([a-z_]+)\.py`", text))
    in_rooms = {n.split(".")[-1] for n in modules_of(PACKAGE) if n.count(".") == 1}
    assert in_rooms - named - {"__init__"} == set()


def test_every_room_is_there():
    rooms = {room_of(name) for name in modules_of(PACKAGE)}
    assert {"geometry", "cell", "search", "planning", "verification", "program", "job"} <= rooms


def test_guests_in_other_programs_use_nothing_of_opl():
    guests = {name for name in modules_of(PACKAGE) if room_of(name) in GUESTS}
    folder = PACKAGE / "plugins" / "freecad"
    own_names = {path.stem for path in folder.iterdir()}
    for name in guests:
        own, others = all_imports(PACKAGE)[name]
        assert own <= guests, name
        assert others <= {*sys.stdlib_module_names, *HOSTS, *own_names}, name
    # what talks to the service is the client of opl itself, copied: the folder is whole
    copied = folder / "opl_workbench" / "client.py"
    assert copied.read_bytes() == (PACKAGE / "client.py").read_bytes()


def test_every_name_that_a_module_offers_exists():
    offering = 0
    for name in modules_of(PACKAGE):
        if room_of(name) in GUESTS:
            continue
        offered = importable(name).__dict__.get("__all__", ())
        offering += bool(offered)
        missing = [one for one in offered if not hasattr(importable(name), one)]
        assert missing == [], name
    assert offering


def test_every_module_says_what_it_is():
    assert without_docstring(PACKAGE) == []


def test_the_search_knows_arrays_and_no_robot():
    searches = [name for name in modules_of(PACKAGE) if room_of(name) == "search"]
    assert "search.recursive" in searches
    for name in searches:
        own, others = all_imports(PACKAGE)[name]
        own = {other for other in own if room_of(other) != "search"}
        assert own <= {"geometry.frames", "files.kernels"}, name
        assert others <= {*sys.stdlib_module_names, "numpy"}, name


def test_the_command_line_uses_nothing_but_the_front_door():
    commands = [name for name in modules_of(PACKAGE) if room_of(name) == "cli"]
    assert "cli.commands" in commands
    for name in commands:
        own, others = all_imports(PACKAGE)[name]
        assert {other for other in own if room_of(other) != "cli"} <= {"__init__"}, name
        assert others <= {*sys.stdlib_module_names, "click", "rich"}, name


def test_every_name_of_the_front_door_exists_and_is_described():
    assert opl.__all__ == sorted(opl.__all__) and len(set(opl.__all__)) == len(opl.__all__)
    for name in opl.__all__:
        assert inspect.getdoc(getattr(opl, name)), name
        assert f"`{name}`" in opl.__doc__, f"{name} is not in the text of the front door"
    assert set(opl.__all__) <= set(dir(opl))


def test_names_of_the_front_door_are_not_those_of_rooms():
    # a room that is imported would take the place of the name
    rooms = {room_of(name) for name in modules_of(PACKAGE)}
    assert not rooms & set(opl.__all__)


def test_type_checkers_see_the_front_door_as_it_is():
    tree = ast.parse((PACKAGE / "__init__.py").read_text())
    (block,) = [
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    seen = {}
    for node in block.body:
        seen.update({alias.asname: (node.module, alias.name) for alias in node.names})
    assert sorted(seen) == opl.__all__
    for name, (home, original) in seen.items():
        assert name == original
        module = importlib.import_module(home)
        assert getattr(opl, name) is getattr(module, name), name


@pytest.mark.parametrize("module", ["opl", "opl.cli.commands"])
def test_what_is_cheap_imports_nothing_heavy(module):
    script = f"import sys, {module}; print(*sys.modules)"
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    loaded = {name.split(".")[0] for name in ended.stdout.split()}
    assert "opl" in loaded
    assert not loaded & {"numpy", "pydantic", "yaml", *HOMES.keys() - {"click"}}


@pytest.mark.parametrize("module", ["opl.motion.engine", "opl.run.stages", "opl.run.delivery"])
def test_what_plans_and_delivers_does_not_load_what_draws(module):
    script = f"import sys, {module}; print(*sys.modules)"
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    loaded = {name.split(".")[0] for name in ended.stdout.split()}
    assert "numpy" in loaded and not loaded & {"matplotlib", "trimesh"}


# what nothing needs that only reads: libraries with one home, and all of scipy
HEAVY = {"scipy", *HOMES.keys() - {"click", "yaml"}}
SHOWN = Path(__file__).parent / "golden" / "SAMPLE.JBI"


@pytest.mark.parametrize(
    ("arguments", "status", "printed"),
    [
        (["show", SHOWN], 0, "flange x"),
        (["show", SHOWN, "--diff", SHOWN], 0, "both do the same"),
        (["check", "job.yaml"], 2, "nmae: unknown key"),
        (["verify", "job.yaml", SHOWN], 2, "nmae: unknown key"),
        (["run", "job.yaml", "--workers", "1"], 2, "nmae: unknown key"),  # else see test_ahead
        (["robots", "show", "mh24", "--json"], 0, "reach_mm"),
    ],
)
def test_commands_that_read_and_refuse_load_nothing_heavy(tmp_path, arguments, status, printed):
    (tmp_path / "job.yaml").write_text("nmae: A\n")
    script = """
import sys
from opl.cli.commands import main
try:
    main(sys.argv[1:])
finally:
    print(*sys.modules, file=sys.stderr)
"""
    ended = subprocess.run(
        [sys.executable, "-c", script, *arguments], cwd=tmp_path, capture_output=True, text=True
    )
    assert ended.returncode == status
    assert printed in ended.stdout + ended.stderr
    loaded = {name.split(".")[0] for name in ended.stderr.splitlines()[-1].split()}
    assert "numpy" in loaded and not loaded & HEAVY


def test_an_unknown_name_is_not_in_the_front_door():
    with pytest.raises(AttributeError, match="module 'opl' has no attribute 'plan'"):
        opl.plan  # noqa: B018


def test_libraries_do_not_set_up_logging_or_print():
    # only the command line prints
    for name, path in modules_of(PACKAGE).items():
        if room_of(name) == "cli":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id != "print", f"{name} prints"
            if isinstance(node, ast.Attribute):
                assert node.attr != "basicConfig", f"{name} sets up logging"


# the test itself


@pytest.fixture
def made_up(tmp_path):
    """Return a function that writes a package from {path: text}."""

    def write(files):
        package = tmp_path / "made_up"
        for path, text in {"__init__.py": "", **files}.items():
            target = package / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text)
        return package

    return write


def test_a_good_tree_passes(made_up):
    package = made_up(
        {
            "errors.py": "class Bad(Exception): ...",
            "geometry/wheel.py": "from made_up.errors import Bad\nimport numpy",
            "cell/robot.py": "import pinocchio\nfrom made_up.geometry import wheel",
            "planning/plan.py": "from made_up.cell import robot\nfrom made_up.planning import path",
            "planning/path.py": "from ..geometry.wheel import y",
        }
    )
    assert wrong_imports(package) == []
    assert cycles(package) == []


@pytest.mark.parametrize(
    ("path", "text", "told"),
    [
        ("geometry/a.py", "from made_up.cell.b import c", "geometry.a imports cell.b"),
        ("geometry/a.py", "import made_up.cell.b", "geometry.a imports cell.b"),
        ("geometry/a.py", "from made_up.cell import b", "geometry.a imports cell.b"),
        ("geometry/a.py", "from ..cell.b import c", "geometry.a imports cell.b"),
        ("geometry/a.py", "from ..cell import b", "geometry.a imports cell.b"),
        (
            "geometry/a.py",
            "def f():\n    from made_up.cell.b import c",
            "geometry.a imports cell.b",
        ),
        ("program/a.py", "from made_up.report.b import c", "program.a imports report.b"),
        (
            "verification/a.py",
            "from made_up.program.b import c",
            "verification.a imports program.b",
        ),
        ("planning/a.py", "from made_up.job import c", "planning.a imports job"),
        ("errors.py", "from made_up.geometry.b import c", "errors imports geometry.b"),
        ("planning/a.py", "import pinocchio as pin", "planning.a imports pinocchio"),
        ("planning/a.py", "if True:\n    from coal import Box", "planning.a imports coal"),
        ("cell/a.py", "import yaml", "cell.a imports yaml"),
        (
            "cell/a.py",
            "from pydantic import Field",
            "cell.a imports pydantic, not files.documents",
        ),
        ("cell/a.py", "import numba", "cell.a imports numba"),
        ("geometry/a.py", "import trimesh.creation", "geometry.a imports trimesh"),
        ("job.py", "import click", "job imports click"),
        ("utils.py", "", "utils is on no floor"),
    ],
)
def test_an_offending_import_is_found(made_up, path, text, told):
    files = {f"{room}/b.py": "c = 1" for room in ("cell", "geometry", "program", "report")}
    package = made_up({**files, "job.py": "c = 1", path: text})
    assert wrong_imports(package) == [told]


def test_a_circle_is_found(made_up):
    files = {
        f"cell/{one}.py": f"from made_up.cell.{other} import x"
        for one, other in pairwise(["a", "b", "c", "a"])
    }
    (circle,) = cycles(made_up(files))
    assert set(circle) == {"cell.a", "cell.b", "cell.c"}


def test_a_long_module_and_leftovers_are_found(made_up):
    package = made_up({"cell/a.py": "x = 1\n" * (LONGEST + 1), "cell/b.py": "# TODO: later"})
    assert without_docstring(package) == ["__init__", "cell.a", "cell.b"]
    assert too_long(package) == ["cell.a"]
    assert with_leftovers(package) == ["cell.b"]
