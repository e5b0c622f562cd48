"""A kernel is compiled by a process of its own, while this one compiles others.

numba compiles one function at a time, however many threads ask for one.  What the other process makes comes back by
numba's cache on disk; where it fails, or cannot write there, this process compiles the kernel itself.
"""

from __future__ import annotations

import atexit
import os
import pickle
import signal
import sys
from contextlib import suppress
from importlib import import_module
from subprocess import DEVNULL, PIPE, Popen
from threading import Thread
from typing import Any

from numba.core import serialize

from vid2ev.compiling.heard import waiting

_SERVE = f"import sys, pickle; sys.path[:] = pickle.load(sys.stdin.buffer); from {__name__} import serve; serve()"
_begun: dict[Any, Popen] = {}  # by kernel and types


class Elsewhere:
    """A kernel for arguments of these types: another process has begun to compile it, unless it is there.

    It is true until it has been waited for, and false where nothing had to be begun, or could not be.
    """

    def __init__(self, kernel: Any, arguments: tuple):
        types = tuple(kernel.typeof_pyval(each) for each in arguments)
        self._key = kernel, types
        if self._key in _begun or not sys.executable or hasattr(sys, "frozen") or _is_there(kernel, types):
            return
        if process := _begin(kernel.py_func, types):
            _begun[self._key] = process

    def __bool__(self) -> bool:
        return self._key in _begun

    def wait(self) -> None:
        """Until the other process has ended, whatever it came to."""
        if process := _begun.get(self._key):
            with waiting():
                _end(process)
            _begun.pop(self._key, None)


def _is_there(kernel: Any, types: tuple) -> bool:
    """Whether it has been compiled, or is on disk."""
    if types in kernel.overloads:
        return True
    cache = kernel._cache
    return cache._index_key(types, kernel.targetctx.codegen()) in cache._cache_file._load_index()


def _begin(function: Any, types: tuple) -> Popen | None:
    request = pickle.dumps(sys.path) + serialize.dumps((function.__module__, function.__name__, types))
    try:
        process = Popen([sys.executable, "-c", _SERVE], bufsize=0, stdin=PIPE, stdout=DEVNULL, stderr=DEVNULL)
    except OSError:
        return None
    assert process.stdin is not None
    with suppress(OSError):  # (it has ended already, which `wait` will see)
        process.stdin.write(request)  # (and it stays open: where it is closed, the other process ends)
    return process


def _end(process: Popen) -> None:
    process.wait()
    assert process.stdin is not None
    process.stdin.close()


def serve() -> None:
    """Compile the kernel that standard input asks for; end at once when that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # (which goes to both; whoever began this will say when to stop)
    module, name, types = pickle.load(sys.stdin.buffer)
    Thread(target=_end_with_parent, daemon=True).start()
    getattr(import_module(module), name).compile(types)


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


@atexit.register
def _end_all() -> None:
    for process in _begun.values():
        process.kill()
        _end(process)
