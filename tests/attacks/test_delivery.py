"""A run that dies, or a disk that fills up, at any step of its delivery."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import opl
from opl.errors import InputError
from opl.files import switching
from opl.files.claiming import LOCK, claimed
from opl.files.writing import HIDDEN

# children use the opl that is tested here
CHILD = {**os.environ, "PYTHONPATH": str(Path(opl.__file__).parents[1])}

OLD = {"V.JBI": b"old\r\n", "V01.JBI": b"old part\r\n", "result.json": b"old result\n"}
NEW = {"V.JBI": "new\r\n" * 2000, "V.csv": "new table\r\n", "result.json": "new result\n"}
LEAVING = {"V01.JBI"}
STRANGERS = {"notes.txt": b"mine", "V_points.csv": b"mine too"}
AFTER = {name: text.encode() for name, text in NEW.items()}

STEPS = [
    "mkdir", "open", "write", "fsync", "link", "replace", "rename", "unlink", "rmdir", "ftruncate",
    "chown", "chmod",
]  # fmt: skip
THAT_NEED_ROOM = ["mkdir", "open", "write", "fsync", "link", "replace", "rename", "ftruncate"]


def put(folder, files):
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)


def deliver(folder):
    with claimed(folder) as claim:
        claim.switch(NEW, LEAVING)


class Steps:
    """Calls to the system that change files, counted; one of them does not happen."""

    def __init__(self, monkeypatch, at, instead):
        self.count = 0
        for name in STEPS if instead is not fill_up else THAT_NEED_ROOM:
            monkeypatch.setattr(os, name, self.counted(getattr(os, name), at, instead))
        exchange = self.counted(switching._exchange_names, at, instead)
        monkeypatch.setattr(switching, "_exchange_names", exchange)

    def counted(self, call, at, instead):
        def step(*arguments, **named):
            self.count += 1
            return (
                instead(call, *arguments, **named)
                if self.count == at
                else call(*arguments, **named)
            )

        return step


def die(call, *arguments, **named):
    os._exit(99)


def die_half_way(call, *arguments, **named):
    """Write one half and die; what is no writing is done before."""
    try:
        if isinstance(arguments[-1], memoryview):
            call(arguments[0], arguments[1][: len(arguments[1]) // 2])
        else:
            call(*arguments, **named)
    finally:
        os._exit(99)


def fill_up(call, *arguments, **named):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def in_a_child(folder, at, instead, stand_in=None):
    """Deliver in a child; return how it ended and how many steps it took, if it lived."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if stand_in is not None:
                os.chdir(stand_in)
            tell = os.write
            with pytest.MonkeyPatch.context() as patch:
                steps = Steps(patch, at, instead)
                try:
                    deliver(folder)
                except InputError as error:
                    assert "cannot be written to" in str(error)
                    os._exit(2)
            tell(write, str(steps.count).encode())
            os._exit(0)
        finally:
            os._exit(1)
    os.close(write)
    told = os.read(read, 20)
    os.close(read)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return status, int(told or 0)


def contents(folder):
    """Return the files of a folder that a user sees."""
    if not folder.is_dir():
        return {}
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.is_file() and not path.name.startswith(HIDDEN)
    }


def hidden(place):
    return [path for path in place.rglob("*") if path.name.startswith(HIDDEN)]


def fresh(home):
    return home / "out" / "V", {}


def earlier(home):
    folder = home / "out" / "V"
    put(folder, {**OLD, **STRANGERS})
    return folder, {**OLD, **STRANGERS}


def linked(home):
    folder, there = earlier(home / "elsewhere")
    (home / "V").symlink_to(folder)
    return home / "V", there


def with_a_folder_in_it(home):
    folder, there = earlier(home)
    (folder / "sub").mkdir()
    (folder / "sub" / "file").write_bytes(b"mine")
    return folder, there


IN_ONE_STEP = {"fresh": fresh, "earlier": earlier, "linked": linked}
CASES = {**IN_ONE_STEP, "with a folder in it": with_a_folder_in_it, "stood in": earlier}


@pytest.mark.parametrize("instead", [die, die_half_way, fill_up])
@pytest.mark.parametrize("case", CASES)
def test_any_step_leaves_the_old_or_the_new_files(tmp_path, case, instead):
    def start():
        shutil.rmtree(tmp_path)
        tmp_path.mkdir()
        folder, before = CASES[case](tmp_path)
        return folder, before, folder if case == "stood in" else None

    folder, before, stand_in = start()
    after = {**AFTER, **{name: STRANGERS[name] for name in STRANGERS if name in before}}
    ended, steps = in_a_child(folder, 0, die, stand_in)
    assert (ended, contents(folder), hidden(tmp_path)) == (0, after, [])
    assert steps > 15
    for at in range(1, steps + 1):
        folder, before, stand_in = start()
        ended, _ = in_a_child(folder, at, instead, stand_in)
        assert ended in ((0, 2) if instead is fill_up else (99,)), at
        found = contents(folder)
        if case in IN_ONE_STEP:
            assert found in (before, after), at
        elif found not in (before, after):  # seen at once: the last file is not there
            assert "result.json" not in found, at
        if ended == 2:
            assert found in (before, after), at
            assert not hidden(tmp_path), at
        with claimed(folder):  # what the next run finds
            assert contents(folder) in (before, after), at
        assert not hidden(tmp_path), at
        deliver(folder)
        assert contents(folder) == after, at
        assert not hidden(tmp_path), at
    if case == "with a folder in it":
        assert (folder / "sub" / "file").read_bytes() == b"mine"


@pytest.mark.skipif(sys.platform != "linux", reason="mounts a small disk")
def test_a_disk_that_is_full_keeps_the_good_result(tmp_path):
    """A real disk of so many kilobytes, in a name space of its own."""
    script = Path(__file__).parent / "full_disk.py"
    ended = subprocess.run(
        ["unshare", "--user", "--map-root-user", "--mount", sys.executable, script, tmp_path],
        capture_output=True, text=True, timeout=120, env=CHILD,
    )  # fmt: skip
    if "unshare" in ended.stderr and ended.returncode == 1:
        pytest.skip(ended.stderr)
    assert ended.returncode == 0, ended.stderr
    refused, done = map(int, ended.stdout.split())
    assert refused > 5 and done > 0


def test_two_runs_into_one_folder_exclude_each_other(tmp_path):
    holder = (
        "import sys, time; from pathlib import Path; from opl.files.claiming import claimed\n"
        "with claimed(Path(sys.argv[1])) as claim: print('held', flush=True); time.sleep(600)"
    )
    command = [sys.executable, "-c", holder, str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=CHILD) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=f"another run writes to it .process {other.pid}."):
            deliver(tmp_path / "out")
        other.send_signal(signal.SIGKILL)
    deliver(tmp_path / "out")
    assert contents(tmp_path / "out") == AFTER
    assert not hidden(tmp_path)


def test_a_lock_that_is_made_in_the_old_state_goes_with_it(tmp_path, monkeypatch):
    """Another process comes upon it on its way to the folder, just before it is removed."""
    folder, remove, made = tmp_path / "out", os.rmdir, []
    put(folder, OLD)

    def rmdir(path):
        if not made and Path(path).name.startswith(HIDDEN + "aside"):
            made.append(Path(path) / LOCK)
            made[0].touch()
        remove(path)

    monkeypatch.setattr(os, "rmdir", rmdir)
    with claimed(folder) as claim:
        held = (folder / LOCK).stat()
        claim.switch(NEW, LEAVING)
        assert os.path.samestat(held, (folder / LOCK).stat())
    assert made and not hidden(tmp_path)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == AFTER


def test_a_lock_left_in_what_is_to_be_removed_does_not_shut_the_folder_for_ever(tmp_path):
    folder = tmp_path / "out"
    put(folder, OLD)
    put(tmp_path / f"{HIDDEN}aside-out", {LOCK: b""})
    deliver(folder)
    assert not hidden(tmp_path)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == AFTER


def test_many_runs_at_once_leave_the_files_of_one(tmp_path):
    """Processes deliver to one folder again and again; a reader never sees a mixture."""
    writer = (
        "import sys; from pathlib import Path; from opl.errors import InputError\n"
        "from opl.files.claiming import claimed\n"
        "done = 0\n"
        "while done < 100:\n"
        "    names = ('A.JBI', 'B.JBI', 'result.json')\n"
        "    texts = {name: f'{sys.argv[2]} {done}' for name in names}\n"
        "    try:\n"
        "        with claimed(Path(sys.argv[1])) as claim: claim.switch(texts)\n"
        "        done += 1\n"
        "    except InputError as error: assert 'another run writes' in str(error), error\n"
    )
    folder = tmp_path / "out"
    folder.mkdir()
    others = [
        subprocess.Popen([sys.executable, "-c", writer, str(folder), name], env=CHILD)
        for name in "abcdef"
    ]
    seen = set()
    while any(other.poll() is None for other in others):
        opened = os.open(folder, os.O_RDONLY)  # one state of it, whatever comes after
        try:
            texts = {
                Path(f"/proc/self/fd/{opened}/{name}").read_text()
                for name in ("A.JBI", "B.JBI", "result.json")
            }
            assert len(texts) == 1
            seen |= texts
        except FileNotFoundError:
            pass  # the old state, being taken away
        finally:
            os.close(opened)
        time.sleep(0.0005)
    assert [other.returncode for other in others] == [0] * len(others)
    assert len(seen) > 20
    assert len({path.read_text() for path in folder.iterdir()}) == 1
    assert not hidden(tmp_path)
