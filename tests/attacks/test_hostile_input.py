"""Files that nobody in his right mind hands in: refused in words, at no cost, nothing written."""

import json
import os
import random
import re
import shutil
import struct
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from opl.cli.commands import main
from opl.errors import InputError
from opl.files.resources import folder
from opl.program.layout import fill
from tests.attacks.attacked import attacked
from tests.conftest import GOLDEN
from tests.support.jobs import V_SHAPE, document, write_job
from tests.support.jobs import opl as in_this_process

SEED = 17
OUT = "out"  # where `opl run` is told to write
LANGUAGES = {
    "JBI": "YRC1000/joint/SAMPLE.JBI", "mod": "RAPID/joint/SAMPLE.mod",
    "src": "KRL/joint/SAMPLE.src", "LS": "FANUC/joint/SAMPLE.LS",
    "script": "URSCRIPT/joint/SAMPLE.script",
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def loaded(tmp_path_factory):
    """Load what commands use, once for all processes that are forked from this one."""
    assert in_this_process("check", write_job(tmp_path_factory.mktemp("job"))).status == 0
    assert in_this_process("show", GOLDEN / LANGUAGES["LS"]).status == 0
    for name in ("opl.run.programs", "opl.cell.urdf_import"):
        import_module(name)


def opl(*arguments):
    return lambda: main([str(argument) for argument in arguments], prog_name="opl")


def snapshot(home, place):
    """Return all files of a case and beside it, without those that its command may write."""
    free = (place / OUT, place.with_suffix(".log"))
    return {
        str(path.relative_to(home)): path.stat().st_size if path.is_file() else None
        for path in home.rglob("*")
        if not any(path.is_relative_to(one) for one in free)
    }


def attack(home, cases):
    """Attack with cases (name, command, write), each in a folder of its own; return the faults."""
    faults, ended, most, longest = [], {}, 0, 0.0
    for number, (name, command, write) in enumerate(cases):
        place = home / f"{number:04d}"
        place.mkdir()
        for part in ("surface.json", "v_shape.stl"):
            shutil.copy(V_SHAPE / part, place)
        write(place)
        before = snapshot(home, place)
        found = attacked(command, place)
        after = snapshot(home, place)
        faults += [f"{name} ({number}): {fault}" for fault in found.faults]
        if after != before:
            faults.append(f"{name} ({number}): wrote {sorted(after.keys() - before.keys())}")
        ended[found.status] = ended.get(found.status, 0) + 1
        most, longest = max(most, found.memory), max(longest, found.seconds)
        shutil.rmtree(place)
    told = f"at most {most / 1e9:.2f} GB and {longest:.1f} s of computing"
    print(f"{len(cases)} inputs, exit statuses {ended}, {told}")
    return faults


# values and bytes


def hostile_values(rng):
    deep = []
    for _ in range(50):
        deep = [deep]
    return rng.choice(
        [
            float("nan"), float("inf"), 1e308, -1e308, 1e-308, 0, -1, 10**30, "", "x", "x" * 10_000,
            [], {}, None, True, [[]], deep, "\x07", "../../../etc/passwd", "/dev/zero", "pipe",
            "ring", ".", "a\0b", [1] * 1000, {"a": {"b": 1}}, "ünï", "0" * 400, [None] * 6,
        ]
    )  # fmt: skip


def places(value, path=()):
    yield path
    if isinstance(value, dict):
        for key in value:
            yield from places(value[key], (*path, key))
    elif isinstance(value, list):
        for key in range(len(value)):
            yield from places(value[key], (*path, key))


def spoiled_value(rng, content):
    """Return keys and values with one of them, or several, replaced, dropped or added."""
    content = json.loads(json.dumps(content))
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        *parents, key = rng.choice([path for path in places(content) if path])
        inner = content
        for parent in parents:
            inner = inner[parent]
        kind = rng.randrange(8)
        if kind == 0:
            del inner[key]
        elif kind == 1 and isinstance(inner, dict):
            inner[rng.choice(["colour", "", 7, "name", "robot"])] = hostile_values(rng)
        elif kind == 2 and isinstance(inner[key], (int, float)):
            inner[key] = inner[key] * rng.choice([1e-9, 1e-3, -1, 1e3, 1e9])
        else:
            inner[key] = hostile_values(rng)
    return content


def spoiled_bytes(rng, raw):
    raw = bytearray(raw)
    for _ in range(rng.choice([1, 3, 20])):
        if not raw:
            break
        at = rng.randrange(len(raw))
        kind = rng.randrange(6)
        if kind == 0:
            raw[at] = rng.randrange(256)
        elif kind == 1:
            del raw[at : at + rng.randrange(1, 200)]
        elif kind == 2:
            raw[at:at] = raw[rng.randrange(len(raw)) :][: rng.randrange(1, 200)]
        elif kind == 3:
            raw[at:at] = rng.choice(
                [b"999999999999", b"-1", b"nan", b"1e999", b"\0", b"\xff\xfe", b"(" * 50, b"[" * 99]
            )
        elif kind == 4:
            del raw[rng.randrange(len(raw)) :]
        else:
            digits = [m.span() for m in re.finditer(rb"\d+", bytes(raw))]
            if digits:
                low, high = rng.choice(digits)
                raw[low:high] = rng.choice([b"0", b"123456789012", b"-7", b"1e400", b"", b"9" * 80])
    return bytes(raw)


def traps(place):
    """Put what never ends beside a job."""
    os.mkfifo(place / "pipe")
    (place / "ring").symlink_to("ring")


# jobs


def job_cases(rng, count, *command):
    for number in range(count):
        content = spoiled_value(rng, document())
        text = yaml.safe_dump(content)
        if number % 4 == 3:
            text = spoiled_bytes(rng, yaml.safe_dump(document()).encode())

        def write(place, text=text):
            traps(place)
            raw = text if isinstance(text, bytes) else text.encode("utf-8", "replace")
            (place / "job.yaml").write_bytes(raw)

        yield command[0], opl(*command), write


def test_jobs_with_spoiled_values(tmp_path):
    assert attack(tmp_path, list(job_cases(random.Random(SEED), 130, "check", "job.yaml"))) == []


RUN = ("run", "job.yaml", "--out", OUT)


def test_whole_runs_of_jobs_with_spoiled_values(tmp_path):
    assert attack(tmp_path, list(job_cases(random.Random(SEED + 1), 120, *RUN))) == []


def odd_number(rng, content):
    """Return keys and values with a number that may still be right, so that much is made of it."""
    content = json.loads(json.dumps(content))
    numbers = [
        path
        for path in places(content)
        if path and isinstance(get(content, path), (int, float)) and get(content, path) is not True
    ]
    *parents, key = rng.choice(numbers)
    inner = get(content, parents)
    inner[key] = inner[key] * rng.choice([-1, 0, 0.5, 0.9, 1.1, 2])
    if isinstance(inner[key], float) and rng.random() < 0.5:
        inner[key] = round(inner[key])
    return content


def get(content, path):
    for key in path:
        content = content[key]
    return content


def test_whole_runs_of_jobs_with_odd_numbers(tmp_path):
    rng, cases = random.Random(SEED + 2), []
    for _ in range(40):
        text = yaml.safe_dump(odd_number(rng, document()))

        def write(place, text=text):
            (place / "job.yaml").write_text(text, encoding="utf-8")

        cases.append(("odd number", opl(*RUN), write))
    assert attack(tmp_path, cases) == []


# texts that are small and mean much


def bomb(levels, width=10):
    lines = ["a0: &a0 [x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * width)}]" for k in range(1, levels)]
    return "\n".join(lines)


TEXTS = {
    "brackets": "[" * 100_000, "braces": "{" * 100_000, "dashes": "- " * 100_000,
    "closed brackets": "[" * 50_000 + "]" * 50_000, "indents": "".join(
        " " * k + "a:\n" for k in range(2500)),
    "bomb": bomb(12), "bomb of merges": "a: &a {x: 1}\n" + "".join(
        f"b{k}: {{<<: [{', '.join(['*a'] * 900)}]}}\n" for k in range(600)),
    "unknown keys": "".join(f"k{k}: 1\n" for k in range(50_000)),
    "one key again": "name: A\n" * 50_000, "long line": "name: " + "x" * 3_900_000,
    "long key": "x" * 2_000_000 + ": 1", "numbers": "a: [" + "1, " * 1_200_000 + "1]",
    "digits": "a: " + "9" * 1_000_000, "quotes": "'" * 100_001, "tags": "a: !!python/object:os.x 1",
    "aliases of nothing": "a: *b", "itself": "&a [*a]", "zeros": "\0" * 1000, "nothing": "",
    "documents": "---\n" * 10_000, "percent": "%YAML 9.9\n---\na: 1", "tabs": "\t" * 10_000,
    "binary": "".join(map(chr, range(1, 256))) * 10, "keys that are lists": "? [a]\n: 1",
}  # fmt: skip


def test_texts_that_grow(tmp_path):
    def case(name, command, file, text):
        def write(place):
            (place / file).write_text(text, encoding="utf-8")

        return name, command, write

    cases = [
        case(f"{name} as {file}", opl(*command), file, text)
        for name, text in TEXTS.items()
        for file, command in (
            ("job.yaml", ("check", "job.yaml")),
            ("surface.json", ("faces", "surface.json")),
            ("cell.yaml", ("cell", "cell.yaml")),
        )
    ]
    assert attack(tmp_path, cases) == []


@pytest.mark.parametrize("place", ["pipe", "ring", "/dev/zero", "/dev/urandom", "/proc/self/mem"])
def test_what_never_ends_is_not_read(tmp_path, place):
    keys = ["workpiece.surface", "workpiece.mesh", "program.template", "program.pulse_ratios",
            "cell", "robot"]  # fmt: skip

    def with_key(key):
        def write(here):
            traps(here)
            (here / "job.yaml").write_text(yaml.safe_dump(document({key: place})))

        return write

    def link(suffix):
        def write(here):
            traps(here)
            (here / f"file{suffix}").symlink_to(place)

        return write

    cases = [(key, opl("check", "job.yaml"), with_key(key)) for key in keys]
    commands = {
        ".yaml": ("check", "file.yaml"), ".json": ("faces", "file.json"),
        ".stl": ("faces", "file.stl", "--unit", "mm"), ".step": ("faces", "file.step"),
        ".JBI": ("show", "file.JBI"), ".LS": ("show", "file.LS"),
        ".urdf": ("robots", "import-urdf", "file.urdf", "--name", "x", "--out", "r"),
        ".PRM": ("robots", "import-params", "file.PRM", "--robot", "mh24", "--out", "p.yaml"),
    }  # fmt: skip
    cases += [(suffix, opl(*command), link(suffix)) for suffix, command in commands.items()]
    assert attack(tmp_path, cases) == []


# geometry


def meshes():
    stl = (V_SHAPE / "v_shape.stl").read_bytes()
    ply = (
        b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
        b"0 0 0\n9 0 0\n0 9 0\n0 0 9\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    )
    obj = b"v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    return {"stl": stl, "ply": ply, "obj": obj}


def test_meshes_of_spoiled_bytes(tmp_path):
    rng = random.Random(SEED)
    cases = []
    for suffix, raw in meshes().items():
        spoiled = [spoiled_bytes(rng, raw) for _ in range(24)]
        if suffix == "stl":
            spoiled += [raw[:80] + struct.pack("<I", n) + raw[84:] for n in (0, 2**32 - 1, 10**8)]
        if suffix == "ply":
            spoiled += [raw.replace(b"vertex 4", b"vertex %d" % n) for n in (10**9, 10**12, 10**30)]
            spoiled += [
                raw.replace(b"ascii", b"binary_little_endian").replace(b"face 4", b"face 999999999")
            ]
        for content in spoiled:

            def write(place, content=content, suffix=suffix):
                (place / f"part.{suffix}").write_bytes(content)

            cases.append((suffix, opl("faces", f"part.{suffix}", "--unit", "mm"), write))
    assert attack(tmp_path, cases) == []


def test_surfaces_of_spoiled_values(tmp_path):
    rng = random.Random(SEED)
    surface = json.loads((V_SHAPE / "surface.json").read_text())
    cases = []
    for _ in range(60):
        content = spoiled_value(rng, surface)

        def write(place, content=content):
            (place / "surface.json").write_text(json.dumps(content))

        cases.append(("surface", opl("faces", "surface.json"), write))
    large = {**surface, "control_points_mm": [[[0.5, 0.25, 0.125]] * 1000] * 1000}

    def write_large(place):
        (place / "surface.json").write_text(json.dumps(large))

    cases.append(("a million points", opl("faces", "surface.json"), write_large))
    assert attack(tmp_path, cases) == []


def test_cad_files_of_spoiled_bytes(tmp_path):
    pytest.importorskip("OCP")
    from tests.units.test_cad import block, write_step

    raw = write_step(block(), tmp_path / "block.step").read_bytes()
    rng = random.Random(SEED)
    cases = []
    for number in range(24):
        suffix = "igs" if number % 6 == 5 else "step"
        content = spoiled_bytes(rng, raw)

        def write(place, content=content, suffix=suffix):
            (place / f"part.{suffix}").write_bytes(content)

        cases.append((suffix, opl("faces", f"part.{suffix}"), write))
    assert attack(tmp_path, cases) == []


# programs, parameters, robots, templates


def test_programs_of_spoiled_bytes(tmp_path):
    rng = random.Random(SEED)
    cases = []
    for suffix, golden in LANGUAGES.items():
        raw = (GOLDEN / golden).read_bytes()
        for number in range(24):
            content = spoiled_bytes(rng, raw)
            verified = number % 4 == 3

            def write(place, content=content, suffix=suffix):
                (place / f"P.{suffix}").write_bytes(content)
                (place / "job.yaml").write_text(yaml.safe_dump(document()))

            command = ("verify", "job.yaml", f"P.{suffix}") if verified else ("show", f"P.{suffix}")
            cases.append((f"{command[0]} {suffix}", opl(*command), write))
    assert attack(tmp_path, cases) == []


def test_parameters_and_urdfs_of_spoiled_bytes(tmp_path):
    rng = random.Random(SEED)
    urdf = (folder("robots") / "mh24" / "mh24.urdf").read_bytes()
    hostile = [spoiled_bytes(rng, urdf) for _ in range(16)]
    for name in ("/etc/passwd", "../../x.stl", "/dev/zero", "file:///etc/hostname"):
        mesh = f'<collision><geometry><mesh filename="{name}"/></geometry></collision><collision>'
        hostile.append(urdf.replace(b"<collision>", mesh.encode(), 1))
    hostile += [b"<a>" * 100_000, b"<robot name='x'>" + b"<link name='a'/>" * 50_000 + b"</robot>"]
    cases = []
    for content in hostile:

        def write(place, content=content):
            (place / "arm.urdf").write_bytes(content)

        # a folder that cannot be made: whatever can be read is refused in the end
        out = ("--out", "arm.urdf/robot")
        cases.append(("urdf", opl("robots", "import-urdf", "arm.urdf", "--name", "x", *out), write))
    prm = b"///SHARE\r\n/CRC\r\nRC1G,1,2,3\r\n" + b"1340.5,123456,0,0\r\n" * 50
    for _ in range(16):
        content = spoiled_bytes(rng, prm)

        def write_prm(place, content=content):
            (place / "ALL.PRM").write_bytes(content)

        command = ("robots", "import-params", "ALL.PRM", "--robot", "mh24", "--out", "no/p.yaml")
        cases.append(("parameters", opl(*command), write_prm))
    assert attack(tmp_path, cases) == []


TEMPLATES = [
    "{{ 'x' * 10**10 }}", "{{ 'x'.center(10**11) }}", "{{ '%1000000000000d' % 1 }}",
    "{% for a in range(99999) %}{% for b in range(99999) %}{% endfor %}{% endfor %}",
    "{% set n=namespace(s='x') %}{% for i in range(60) %}{% set n.s = n.s ~ n.s %}{% endfor %}",
    "{% macro f() %}{{ f() }}{% endmacro %}{{ f() }}", "{{ ''.__class__.__mro__ }}",
    "{% include '/etc/passwd' %}", "{% import 'os' as os %}", "{% for %}", "{{ nothing.x }}",
    "{{ [1] * 10**9 }}", "{{ range(100000)|batch(1)|list|string * 10 }}", "{{ " + "(" * 5000,
]  # fmt: skip


def test_templates_that_grow(tmp_path):
    cases = []
    for text in TEMPLATES:

        def write(place, text=text):
            (place / "t.j2").write_text(text)

        def command(text=text):

            try:
                print(len(fill(Path("t.j2"), {"name": "A"})))
            except InputError as error:
                print(error)
                raise SystemExit(2) from None

        cases.append((f"template {text[:30]}", command, write))
    assert attack(tmp_path, cases) == []
