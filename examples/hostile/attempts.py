"""A process that reads changed files one after the other; what kills it is seen by whoever started it.

    python -m hostile.attempts READER[,READER...] FOLDER FIRST COUNT        (in examples/)

Attempt n depends on its number and on what attempts before it in this process have found: content with which a line
of vid2ev or interp ran for the first time, or that was refused with a sentence of another wording, is changed further.

FOLDER/READER/seeds       the valid files, one of which is changed for each attempt
FOLDER/READER/offending   what was neither read nor refused in a sentence, and the trace of each
FOLDER/READER/tally.json  how the attempts ended, so far; the number of the last one that was begun
"""

from __future__ import annotations

import faulthandler
import json
import os
import re
import resource
import shutil
import signal
import sys
import traceback
import warnings
import zlib
from collections import Counter
from contextlib import nullcontext
from pathlib import Path

import numpy as np
from hostile.coverage import Coverage

SECONDS = 20  # of the processor for an attempt
LONGEST_S = 600  # for one that waits
SPACE = 6 << 30  # bytes of address space beyond those that the process has when it has read the valid files
PEAK_MB = 900  # of memory in use beyond those; twice what `VID2EV_LARGEST_MB` is set to, and what reading takes
LARGEST_MB = 256
FILE_MB = 512  # of a file that is written
MOST_KINDS = 60  # of content that is changed further, for each valid file, of what was read and of what was refused
COVERED = 4  # one of so many attempts is looked at line by line
TALLY_EVERY = 500


def kilobytes(key: str) -> int:
    """A line of /proc/self/status."""
    found = re.search(rf"{key}:\s+(\d+)", Path("/proc/self/status").read_text())
    return int(found[1]) if found else 0


class Attempts:
    """Attempts at a reader, in a folder."""

    def __init__(self, name: str, folder: Path):
        from hostile.readers import READERS, check

        self.reader, self.check, self.folder = READERS[name], check, folder
        seeds = folder / "seeds"
        shutil.rmtree(seeds, ignore_errors=True)
        seeds.mkdir(parents=True)
        self.paths = self.reader.seeds(seeds)
        self.valid = [path.read_bytes() for path in self.paths]
        self.new: list[dict[str, list[bytes]]] = [{"valid": [], "read": [], "refused": []} for _ in self.paths]
        self.tally: Counter[str] = Counter()
        self.known: set[str] = set()
        self.coverage = Coverage()
        for path in self.paths:
            with self.coverage:
                self.reader.read(path)
        self._before_kb = kilobytes("VmRSS")

    def limit(self) -> None:
        """From here on, no more memory than is stated above."""
        size = (kilobytes("VmSize") << 10) + SPACE
        resource.setrlimit(resource.RLIMIT_AS, (size, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_MB << 20, resource.RLIM_INFINITY))

    def attempt(self, number: int) -> None:
        """Change a file, read it, and note how that ended."""
        from hostile.mutate import mutated

        random = np.random.default_rng([zlib.crc32(self.folder.name.encode()), number])
        at = number % len(self.paths)
        path, valid, new = self.paths[at], self.valid[at], self.new[at]
        among = new[str(random.choice(["valid", "read", "refused"], p=[0.5, 0.35, 0.15]))]
        content = mutated(among[int(random.integers(len(among)))] if among else valid, random, self.valid)
        path.write_bytes(content)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(LONGEST_S)
        covered = number % COVERED == 0
        with self.coverage if covered else nullcontext():
            ended, kind = self._read(path)
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)
        if any(file.stat().st_size == FILE_MB << 20 for file in self.folder.rglob("*") if file.is_file()):
            ended, kind = "filled", "a file as large as it may be"
        self.tally[ended] += 1
        if ended not in new:
            self.keep(path, content, number, kind)
        elif ((covered and self.coverage.found) or kind not in self.known) and len(new[ended]) < MOST_KINDS:
            self.known.add(kind)
            new[ended].append(content)
        path.write_bytes(valid)

    def _read(self, path: Path) -> tuple[str, str]:
        """How reading ended, and what tells it from others."""
        from vid2ev.errors import Vid2evError

        try:
            self.reader.read(path)
        except Vid2evError as error:
            try:
                self.check(error)
            except AssertionError:
                return "no sentence", traceback.format_exc()
            inner = error.__cause__
            where = f"{type(inner).__name__}{str(inner)[:40]}" if inner else ""
            return "refused", re.sub(r"[\d.'\"]+|/\S+", "", f"{error}{where}")[:200]
        except Exception:
            return "broke", traceback.format_exc()
        return "read", path.name

    def keep(self, path: Path, content: bytes, number: int, trace: str) -> None:
        """Put an offending file aside, the first of each kind."""
        place = self.folder / "offending"
        place.mkdir(exist_ok=True)
        last = trace.strip().splitlines()[-3:]
        kind = zlib.crc32(re.sub(r"[\d.]+|/\S+", "", "".join(last)).encode())
        if not list(place.glob(f"*-{kind:08x}-*.txt")):
            (place / f"{number}-{kind:08x}-{path.name}").write_bytes(content)
            (place / f"{number}-{kind:08x}-{path.name}.txt").write_text(trace)

    def greedy(self) -> bool:
        """Whether more memory was in use than may be since this was asked last."""
        peak_kb = kilobytes("VmHWM")
        Path("/proc/self/clear_refs").write_text("5")
        return peak_kb - self._before_kb > PEAK_MB << 10


def main(name: str, place: str, first: int, count: int) -> None:
    """Make `count` attempts from number `first` on."""
    folder = Path(place) / name
    folder.mkdir(parents=True, exist_ok=True)
    os.environ["VID2EV_LARGEST_MB"] = str(LARGEST_MB)
    faulthandler.enable(sys.stderr)
    attempts = Attempts(name, folder)
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", "Reading `.npy` or `.npz` file required")  # (numpy's word on files of Python 2)
    attempts.limit()
    for number in range(first, first + count):
        with open(folder / "current", "w") as current:
            current.write(f"{number} {number % len(attempts.paths)}")
        attempts.attempt(number)
        if number % 20 == 0 and attempts.greedy():
            attempts.tally["greedy"] += 1
            attempts.keep(Path("greedy"), b"", number, f"attempts up to {number}")
        if (number + 1) % TALLY_EVERY == 0 or number + 1 == first + count:
            said = {"next": number + 1, "tally": attempts.tally}
            (folder / "tally.new").write_text(json.dumps(said))
            (folder / "tally.new").replace(folder / "tally.json")


if __name__ == "__main__":
    for reader in sys.argv[1].split(","):
        main(reader, sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
