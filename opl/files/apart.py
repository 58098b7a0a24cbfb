"""Work on strangers' files in a process of its own, with limits: it may crash or grow in there.

The limits are counted, not timed: seconds of computing and bytes of memory. A machine under load
comes to the same end.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any, TypeVar

from opl.errors import InputError

MOST_SECONDS = 20  # of computing
MOST_MEMORY = 1_400_000_000  # bytes of data

# what the process does: the same modules as here, nothing of the folder that it stands in
_CHILD = """
import os, pickle, sys
answer = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
sys.path[:], parent = pickle.load(sys.stdin.buffer)
from opl.files.apart import answer_for
answer.write(answer_for(parent, sys.stdin.buffer.read()))
answer.close()
os._exit(0)
"""

Result = TypeVar("Result")


def apart(function: Callable[..., Result], *arguments: object, about: str) -> Result:
    """Return what a function returns, called in a process of its own.

    Args:
        function: It lies in a module; what it returns and raises leaves the process as bytes.
        arguments: What it is called with.
        about: The file that the work is about, for messages.

    Raises:
        InputError: If the function raises one, or the process ends without an answer: it crashed,
            or came to a limit.
    """
    request = pickle.dumps((sys.path, os.getpid())) + pickle.dumps((function, arguments))
    # threads of numerical libraries would each take memory
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    ended = subprocess.run(
        [sys.executable, "-I", "-c", _CHILD],
        input=request,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **threads},
        check=False,
    )
    if not ended.stdout:
        raise InputError(about, f"cannot be used: {_end(ended.returncode)}")
    where, found = pickle.loads(ended.stdout)
    if where is not None:
        raise InputError(where or about, found)
    result: Result = found
    return result


def _end(status: int) -> str:
    if status == -signal.SIGXCPU or status == -signal.SIGKILL:
        return f"it takes more than {MOST_SECONDS} s of computing"
    if status < 0:
        return f"what reads it crashed ({signal.Signals(-status).name})"
    return f"what reads it ended with status {status}"


def end_with_parent(parent: int) -> None:
    """Let the system end this process when the one that started it ends, where it can (Linux).

    If that process, given its number, ended while this one started, it ends here.
    """
    call = getattr(ctypes.CDLL(None), "prctl", None)
    if call is not None:
        call(1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        os._exit(1)


def answer_for(parent: int, request: bytes) -> bytes:
    """Return the answer of the process to a request of another one, within its limits."""
    end_with_parent(parent)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 1))
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
    answer: tuple[str | None, Any]
    try:
        function, arguments = pickle.loads(request)
        answer = None, function(*arguments)
    except InputError as error:
        answer = error.where, error.message
    except MemoryError:
        answer = "", f"cannot be used: it takes more than {MOST_MEMORY / 1e9:g} GB of memory"
    except Exception as error:  # of a library that stumbles over the file
        answer = "", f"cannot be used: {type(error).__name__}: {error}"
    return pickle.dumps(answer)
