"""A conversion in a process of its own, killed as by `kill -9` when it reports for the n-th time."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from forked import forks_of

RUN = """
import json, os, signal, sys
from vid2ev import convert

last, seen = int(sys.argv[1]), 0

def report(*_):
    global seen
    seen += 1
    if seen == last:
        os.kill(os.getpid(), signal.SIGKILL)

convert(sys.argv[2], sys.argv[3], report=report, **json.loads(sys.argv[4]))
print(seen)
"""


def converted(
    clip: str | Path, directory: Path, options: dict[str, object], killed_at: int = 0, before: str = ""
) -> subprocess.CompletedProcess[str]:
    """Convert with these options of `convert`, after the program `before`; prints how many reports there were."""
    arguments = [str(killed_at), str(clip), str(directory), json.dumps(options)]
    return forks_of("import vid2ev.making.conversion").run(before + RUN, *arguments)
