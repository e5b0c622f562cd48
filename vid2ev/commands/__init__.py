"""The command line: each command parses, makes one call and prints.

Commands are entry points of the group `vid2ev.commands`, so that other packages can add theirs; their modules import
what is heavy when they are called.
"""

from __future__ import annotations

import difflib
import errno
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from itertools import pairwise
from typing import Any, NoReturn

import click

from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.interrupts import never_lost

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
DEEPEST = 400  # folders in a path
INTERRUPTED = 130  # the exit code of a program ended by Ctrl-C
KEPT = "what is done is kept, the same command with --resume goes on"
NOT_KEPT = "nothing is left behind"
GPU_FULL = "the GPU's memory is full; take smaller frames, tiles or batches, or the CPU"
SHARED_FULL = "shared memory (/dev/shm) is full; give it more room, or take --workers 0"
MEMORY_FULL = "the memory is full; take smaller frames, tiles or batches, or fewer workers"
NO_THREAD = "no thread can begin here, for want of memory or as no more processes may run; raise these limits (ulimit)"


def say_interrupted(remedy: str = "") -> NoReturn:
    """The end of a command that was asked to, and what there is to do then."""
    click.echo("; ".join(filter(None, ("interrupted", remedy))), err=True)
    sys.exit(INTERRUPTED)


class Commands(click.Group):
    """The commands of all installed packages, by name."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(entry_points(group="vid2ev.commands").names)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        found = entry_points(group="vid2ev.commands", name=cmd_name)
        return next(iter(found)).load() if found else None

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        refuse_nothing(args)
        refuse_depths(args)
        refuse_standard_output(args)
        names = self.list_commands(ctx)
        if args and args[0] not in names and not args[0].startswith("-"):
            close = difflib.get_close_matches(args[0], names, n=1, cutoff=0.5)
            hint = f"did you mean {close[0]}?" if close else f"the commands are {', '.join(names)}"
            raise click.UsageError(f"no command '{args[0]}'; {hint}", ctx)
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As `invoke`: of help and the version, which are printed here."""
        with said_in_a_sentence():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Errors meant for people become one line; what else goes wrong keeps its traceback."""
        logging.getLogger("matplotlib").setLevel(logging.ERROR)  # (it warns where there is no home to keep its letters)
        with said_in_a_sentence(), never_lost():
            return super().invoke(ctx)


@contextmanager
def said_in_a_sentence() -> Iterator[None]:
    """Ends the program where errors are meant for people, with one line."""
    try:
        yield
    except Vid2evError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(error.exit_code)
    except OSError as error:
        if error.filename is None and (error.errno not in NO_ROOM or not _printing_fails()):
            raise  # (click ends quietly where nobody reads on)
        if error.filename is None:
            place = "standard output cannot be written"
            click.echo(f"error: {place}: {error.strerror}; make room, or print to another place", err=True)
            _print_nowhere()
            sys.exit(DataError.exit_code)
        click.echo(f"error: {as_told(error)}", err=True)
        sys.exit(DataError.exit_code)
    except Exception as error:
        if (told := as_told(error)) is error:
            raise
        click.echo(f"error: {told}", err=True)
        sys.exit(DataError.exit_code)
    except KeyboardInterrupt:
        say_interrupted()


def _printing_fails() -> bool:
    """Whether nothing can be printed, as on a disk that is full."""
    try:
        print(flush=True)
    except OSError:
        return True
    return False


def _print_nowhere() -> None:
    """What is waiting to be printed is dropped: Python would try it again at its end, and complain."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def as_told(error: Exception) -> Exception:
    """What a person is told of a file that cannot be opened and of memory that is full; other errors as they are."""
    if isinstance(error, OSError) and not isinstance(error, Vid2evError) and error.filename is not None:
        # (no name of a file, a folder that may not be entered: what the system says of it is all that is known)
        return DataError(f"{error.filename}: {error.strerror}; give the name of a file that can be opened")
    full = what_is_full(error)
    return DataError(full) if full else error


def what_is_full(error: Exception) -> str | None:
    """A sentence for an error that means that there is no more memory, or no more threads; None for all others.

    numpy, Python and FFmpeg raise MemoryError; torch and OpenCV errors of their own, which take a second to import.
    """
    if type(error).__name__ == "OutOfMemoryError":
        return GPU_FULL
    said = str(error)
    if "unable to allocate shared memory" in said or "out of shared memory" in said:
        return SHARED_FULL
    if said == "can't start new thread":  # (of Python, which does not know which of the two it is)
        return NO_THREAD
    theirs = "DefaultCPUAllocator: can't allocate memory" in said or "Insufficient memory" in said
    return MEMORY_FULL if isinstance(error, MemoryError) or theirs else None


def refuse_nothing(words: list[str]) -> None:
    """Raise UsageError for an empty word: as the name of a file it would be the folder one is in, or the default."""
    for before, word in pairwise(["vid2ev", *words]):
        if word == "" or (word.startswith("--") and word.endswith("=")):
            raise UsageError(f"nothing after '{word or before}': expected a value; a shell's variable may be empty")


def refuse_depths(words: list[str]) -> None:
    """Raise UsageError for a path of very many folders, which Python makes one within the call for another."""
    for word in words:
        if (folders := word.count("/")) > DEEPEST:
            raise UsageError(f"{word}: {folders} folders deep, expected at most {DEEPEST}; go there first, with cd")


def refuse_standard_output(words: list[str]) -> None:
    """Raise UsageError where what is to be made is called `-`: it would be a file or folder of that name."""
    for before, word in pairwise(words):
        out = before in ("-o", "--output") or (words[0] == "reformat" and before != "reformat")  # (whose first is IN)
        if word in ("-o-", "--output=-") or (word == "-" and out):
            raise UsageError("-: files and folders are made, nothing goes to standard output; give a name")


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="vid2ev", message="%(package)s %(version)s")
def main() -> None:
    """Ordinary video in, what an event camera would have recorded out."""
