"""Blender as a process: found, started, asked, ended.

found   by name or path; else the environment variable VID2EV_BLENDER; else `blender` on PATH.  A Python that has
        bpy, Blender as a module, will do: its name begins with `python`
asked   the path of a request on its standard input; `vid2ev: done` on its standard output when it is answered
        (`inside_blender.py`)
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

from vid2ev.errors import DataError, UsageError

VARIABLE = "VID2EV_BLENDER"
SCRIPT = Path(__file__).with_name("inside_blender.py")
SIGN = "vid2ev: "
OLDEST = (4, 2)  # 3.4 has another sampling pattern, and dies of the passes
PATIENCE_S = 20.0  # for Blender to end
ERROR = re.compile(r"[\w.]*(Error|Exception): ")  # the last line of a traceback, which may stand on either stream


def find_blender(program: str | None = None) -> Path:
    """The program that is Blender, or a Python that has it.  Raises UsageError if there is none."""
    named = program or os.environ.get(VARIABLE)
    found = shutil.which(named or "blender")
    if found is None:
        what = f"Blender '{named}' is no program that can be run" if named else "Blender is not installed"
        raise UsageError(f"{what}; give its path with --blender or {VARIABLE} (or that of a Python that has bpy)")
    return Path(found)


def command_of(program: Path) -> list[str]:
    """How the program is started."""
    if program.name.startswith("python"):
        return [str(program), "-P", str(SCRIPT)]  # (not with the modules beside the script)
    return [str(program), "--background", "--factory-startup", "--python-exit-code", "1", "--python", str(SCRIPT)]


class Blender:
    """A running Blender.

    version  what it says of itself

    Raises UsageError if it cannot be run or is too old, DataError if it ends at once.
    """

    def __init__(self, program: Path):
        self._program = program
        self._errors = tempfile.TemporaryFile(mode="w+", errors="replace")  # noqa: SIM115 (until `close`)
        try:
            self._process = subprocess.Popen(
                command_of(program),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                text=True,
                errors="replace",
            )
        except OSError as error:
            self._errors.close()
            raise UsageError(f"Blender '{program}' cannot be run: {error.strerror}; give another") from error
        self.version = self._answer()
        if tuple(int(part) for part in re.findall(r"\d+", self.version)[:2]) < OLDEST:
            self.close()
            raise UsageError(f"Blender '{program}' is of version {self.version}; give one of 4.2 or later")

    def ask(self, request: Path) -> None:
        """Have a request answered.  Raises DataError if Blender fails."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # (it has ended: why is in its errors)
            # (past the buffer, which could not be closed with what a Blender that has ended did not read)
            os.write(self._process.stdin.fileno(), os.fsencode(f"{request}\n"))
        self._answer()

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._errors.close()

    def _answer(self) -> str:
        """Its next sign."""
        assert self._process.stdout is not None
        said = []
        for line in self._process.stdout:
            if line.startswith(SIGN):
                return line[len(SIGN) :].strip()
            if ERROR.match(line):
                said.append(line.strip())
        code = self._process.wait()
        self._errors.seek(0)
        said += [line.strip() for line in self._errors if line.strip()]
        self.close()
        ending = f"exit code {code}" if code >= 0 else signal.Signals(-code).name
        reason = next((line for line in reversed(said) if ERROR.match(line)), said[-1] if said else ending)
        raise DataError(f"Blender '{self._program}' failed: {reason}; run it on its own to see whether it works")
