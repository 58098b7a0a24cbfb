"""Work on strangers' files in processes that start warm: forked of one that has loaded the readers.

`opl.files.apart` starts an interpreter for every file, which loads for a second. Tests of many
spoiled files need a process for each, its limits and its answers, but not that second. That an
interpreter does the same is left to tests of a few whole files.
"""

import os
import pickle
import subprocess
import sys
from functools import cache
from io import BytesIO
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import SimpleNamespace

from opl.files.apart import answer_for

_SERVER = """
import sys
sys.path[:] = {path}
import opl.geometry.cad
from tests.support.warm_processes import serve
serve({number})
"""


def run(command, *, input, **_):
    """Return what `subprocess.run` of apart's interpreter would."""
    message = BytesIO(input)
    pickle.load(message)  # where an interpreter would find its modules
    _server().send_bytes(message.read())
    return subprocess.CompletedProcess(command, *_server().recv())


# of the module subprocess what apart uses
STAND_IN = SimpleNamespace(run=run, PIPE=subprocess.PIPE, DEVNULL=subprocess.DEVNULL)


@cache
def _server():
    """Start the process that others are forked of; it ends when its connection does."""
    here, there = Pipe()
    subprocess.Popen(
        [sys.executable, "-I", "-c", _SERVER.format(path=sys.path, number=there.fileno())],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # threads are not forked
        pass_fds=[there.fileno()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    there.close()
    return here


def serve(number):
    """Answer each request in a process of its own, until there are no more."""
    asked = Connection(number)
    while True:
        try:
            request = asked.recv_bytes()
        except EOFError:
            return
        pickle.loads(request)  # loads all modules that it names
        answer, end = os.pipe()
        process = os.fork()
        if process == 0:
            with os.fdopen(end, "wb") as pipe:
                pipe.write(answer_for(os.getppid(), request))
            os._exit(0)
        os.close(end)
        with os.fdopen(answer, "rb") as pipe:
            told = pipe.read()
        asked.send((os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), told))
