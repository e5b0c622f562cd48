"""What is checked of a place before anything is made for it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vid2ev import DataError, UsageError
from vid2ev.recording.destination import check_apart, check_destination, check_new
from vid2ev.recording.manifest import identity
from vid2ev.views.destination import check_free as shown_free


@pytest.mark.parametrize("place", ["file/new", "file/new/newer"])
def test_nothing_can_be_within_a_file(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").touch()
    for check in (check_destination, lambda path: check_new(path, overwrite=True)):
        with pytest.raises(DataError, match=rf"{place} cannot be written: .*file is a file; choose another place"):
            check(tmp_path / place)
        check(tmp_path / "folder" / place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_new_file_takes_the_place_of_a_file_if_asked_and_never_of_a_folder(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    check_new(file, overwrite=True)
    with pytest.raises(UsageError, match="file exists; --overwrite replaces it"):
        check_new(file, overwrite=False)
    for overwrite in (True, False):
        with pytest.raises(UsageError, match="exists; give a file's name"):
            check_new(tmp_path, overwrite)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are no pipes that have names")
@pytest.mark.parametrize("check", [check_new, shown_free], ids=["files", "pictures"])
def test_a_new_file_never_takes_the_place_of_a_link_or_a_pipe(
    tmp_path: Path, check: Callable[[Path, bool], None]
) -> None:
    """Nor of a device, such as /dev/null, which is there for all."""
    pipe, link, nowhere = (tmp_path / f"{name}.png" for name in ("pipe", "link", "nowhere"))
    os.mkfifo(pipe)
    (tmp_path / "file").touch()
    link.symlink_to("file")
    nowhere.symlink_to("missing")
    for path, said in ((pipe, "is no file but a pipe"), (link, "is a link"), (nowhere, "is a link")):
        for overwrite in (True, False):
            with pytest.raises(UsageError, match=f"{path.name} {said}"):
                check(path, overwrite)


def test_a_folder_that_may_not_be_written_to_is_known_before_anything_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed, file = tmp_path / "closed", tmp_path / "closed" / "file"
    closed.mkdir()
    file.touch()
    closed.chmod(0o555)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).stat().st_mode & 0o200)  # (root may write anywhere)
    for place in (file, closed / "new", closed / "folder" / "new"):
        with pytest.raises(DataError, match=rf"{place.name} cannot be written: .*closed may not be written to; choose"):
            check_new(place, overwrite=True)
    closed.chmod(0o755)
    check_new(file, overwrite=True)


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
def test_a_link_to_itself_is_a_link(tmp_path: Path) -> None:
    ring = tmp_path / "ring"
    ring.symlink_to("ring")
    (tmp_path / "source").mkdir()
    check_apart(tmp_path / "source", ring)
    check_apart(ring, tmp_path / "out")
    assert identity(tmp_path / "source", besides=[ring]) == identity(tmp_path / "source")
    for check in (check_destination, lambda path: check_new(path, overwrite=True)):
        with pytest.raises(UsageError, match="ring is a link"):
            check(ring)
