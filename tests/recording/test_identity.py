"""What tells files from others: all that is in them, as far as their beginnings and ends say so."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from vid2ev.recording.manifest import HEAD, identity


def folder_of(path: Path, files: int, size: int) -> Path:
    (path / "inner").mkdir(parents=True)
    for k in range(files):
        (path / f"{k:03d}").write_bytes(bytes(size))
    (path / "inner" / "more").write_bytes(bytes(size))
    return path


@pytest.mark.parametrize("size", [0, 1, 4000, 3 * HEAD])
@pytest.mark.parametrize("files", [1, 3])
def test_another_beginning_or_end_of_any_file_is_another(tmp_path: Path, files: int, size: int) -> None:
    folder = folder_of(tmp_path / "a", files, size)
    for path in (folder, *(each for each in folder.iterdir() if each.is_file())):
        for place in (0, size - 1) if size else ():
            known = identity(path, copies=True)
            with open(path / "000" if path.is_dir() else path, "r+b") as file:
                file.seek(place)
                file.write(b"1")
            assert identity(path, copies=True) != known
            file_again = path / "000" if path.is_dir() else path
            with open(file_again, "r+b") as file:
                file.seek(place)
                file.write(b"\0")
            assert identity(path, copies=True) == known
    known = identity(folder)
    (folder / "000").rename(folder / "other")
    assert identity(folder)["sha256"] != known["sha256"] and identity(folder)["bytes"] == known["bytes"] == files * size


def test_a_copy_is_the_same_where_times_do_not_count(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", 2, 1000)
    shutil.copytree(folder, tmp_path / "b")
    for path in (tmp_path / "b").iterdir():
        os.utime(path, (0, 0))
    assert identity(folder, copies=True) == identity(tmp_path / "b", copies=True)
    assert identity(folder) != identity(tmp_path / "b")


def test_folders_in_a_folder_count_where_that_is_asked(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", 2, 1000)
    known = [identity(folder, copies=True, deep=deep) for deep in (False, True)]
    (folder / "inner" / "more").write_bytes(b"1" * 1000)
    now = [identity(folder, copies=True, deep=deep) for deep in (False, True)]
    assert known[0] == now[0] and known[1] != now[1] and (known[0]["bytes"], known[1]["bytes"]) == (2000, 3000)
