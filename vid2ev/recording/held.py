"""Folders that one process writes, and no other meanwhile."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

from vid2ev.errors import UsageError
from vid2ev.interrupts import ENDING

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

LOCK = "lock"  # the file of a folder that who writes it has locked


class Held:
    """A folder for this process alone, from `take` to `close`, or as a context.

    It is made if it is not there, and if nothing was put into it then, it is gone in the end; nothing is left of the
    lock.  It is free again, too, when the process ends, however that does.  Raises OSError where there can be no such
    folder.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._handle: int | None = None
        self._made = False

    def __bool__(self) -> bool:
        """Whether it is held."""
        return self._handle is not None

    def take(self) -> None:
        """Hold it; raises UsageError if another process does.  Who is asked to end meanwhile knows what it holds."""
        with undisturbed():
            self._made = not self.folder.exists()
            self.folder.mkdir(parents=True, exist_ok=True)
            self._handle = _locked(self.folder)

    def close(self) -> None:
        """Let others at it, if it is held."""
        if self._handle is None:
            return
        if _is_at(self._handle, self.folder / LOCK):
            with suppress(OSError):  # (while it is held: who has opened it meanwhile sees that it is gone)
                (self.folder / LOCK).unlink()
        if self._made:
            with suppress(OSError):  # (there is something in it)
                self.folder.rmdir()
        os.close(self._handle)
        self._handle = None

    def __enter__(self) -> Self:
        try:
            self.take()
        except BaseException:  # (who was asked to end meanwhile holds it)
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Signals that ask the program to end wait until this is done: who clears up knows what was taken within."""
    if threading.current_thread() is not threading.main_thread():  # (others hear none)
        yield
        return
    before, asked = {number: signal.getsignal(number) for number in ENDING}, list[int]()
    try:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, lambda number, _: asked.append(number))
        yield
    finally:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, handler)
    for number in asked[:1]:
        signal.raise_signal(number)


def _locked(folder: Path) -> int:
    """A handle that keeps others from a folder for as long as it is open."""
    handle = os.open(folder / LOCK, os.O_CREAT | os.O_RDWR)
    if fcntl is None:
        return handle
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise UsageError(f"another vid2ev is writing {folder}; wait for it, or choose another folder") from None
    if _is_at(handle, folder / LOCK):
        return handle
    os.close(handle)  # (who held it has removed it since it was opened, and others may hold a new one)
    folder.mkdir(parents=True, exist_ok=True)
    return _locked(folder)


def _is_at(handle: int, path: Path) -> bool:
    """Whether the file of a handle is still there by its name."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(handle), os.stat(path))
    return False
