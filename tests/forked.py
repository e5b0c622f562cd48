"""Programs that are forked from one that has already imported and compiled what they need, and that may be killed.

A program that starts from nothing takes seconds to do that, and tests of what is killed and goes on start dozens.
"""

from __future__ import annotations

import atexit
import functools
import json
import subprocess
import sys
import tempfile
from pathlib import Path

SERVER = """
import json, os, sys, traceback

def forked(program, arguments, outputs):
    for number, path in zip((1, 2), outputs):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.argv, code = ["-c", *arguments], 1
    try:
        exec(compile(program, "-c", "exec"), {"__name__": "__main__"})
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)

exec(sys.argv[1])
for line in sys.stdin:
    asked = json.loads(line)
    child = os.fork() or forked(*asked)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@functools.cache
def forks_of(before: str) -> Forks:
    """One such process for all that have the program `before` in common; it ends with this one."""
    forks = Forks(before)
    atexit.register(forks.end)
    return forks


class Forks:
    """Processes that are forked from one that has run the program `before`, which may not leave threads behind."""

    def __init__(self, before: str):
        command = [sys.executable, "-c", SERVER, before]
        self._server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a program with these arguments, as `subprocess.run` would with `python -c`; what it says is text."""
        assert self._server.stdin and self._server.stdout
        with tempfile.TemporaryDirectory() as folder:
            outputs = [str(Path(folder) / name) for name in ("out", "err")]
            print(json.dumps([program, arguments, outputs]), file=self._server.stdin, flush=True)
            code = int(self._server.stdout.readline())
            return subprocess.CompletedProcess(arguments, code, *(Path(path).read_text() for path in outputs))

    def end(self) -> None:
        """No more of them."""
        assert self._server.stdin and self._server.stdout
        self._server.stdin.close()
        self._server.wait()
        self._server.stdout.close()
