"""The folder of a recording: there as a whole or not at all, what it must not touch it leaves, and it resumes."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.columns import EventColumns, column_files
from vid2ev.recording.destination import partial_of
from vid2ev.recording.disk import whole
from vid2ev.recording.folder import Folder, begun_job, check_free
from vid2ev.recording.held import Held
from vid2ev.recording.manifest import write_manifest
from vid2ev.stream.events import Events

JOB = {"versions": {"vid2ev": "0"}, "sensor": {"threshold_on": 0.15}, "seed": 3}
OTHER = JOB | {"sensor": {"threshold_on": 0.2}}


COLUMNS = {"growing": column_files()}


def events_at(*t: int) -> Events:
    n = len(t)
    zeros = np.zeros(n, np.uint8)
    return Events(np.array(t, np.int64), np.full(n, 7, np.uint16), np.full(n, 9, np.uint16), zeros, zeros)


def made(folder: Folder) -> Path:
    for name in ("events.h5", "manifest.json"):
        (folder.whole / name).write_text(name)
    write_manifest(folder.whole / "manifest.json", folder.job)
    folder.publish()
    return folder.directory


def tree(path: Path) -> dict[str, bytes]:
    return {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


def begun(directory: Path) -> None:
    """A conversion that was killed after its checkpoint: two events in it, a third beyond."""
    folder = Folder(directory, JOB, **COLUMNS)
    folder.__enter__()
    columns = EventColumns(folder)
    columns.append(events_at(1, 2))
    folder.checkpoint({"level": np.arange(4.0)})
    columns.append(events_at(3))
    for file in folder._files.values():
        file.flush()
    folder.__exit__(None, None, None)  # (what a kill does to the lock; with a checkpoint it leaves the files)


def test_it_appears_as_a_whole(tmp_path: Path) -> None:
    with Folder(tmp_path / "out", JOB) as folder:
        assert not (tmp_path / "out").exists()
        made(folder)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["events.h5", "manifest.json"]


def test_a_full_disk_says_how_to_go_on_where_there_is_something_to_go_on_with(tmp_path: Path) -> None:
    for checkpoint, remedy in ((False, "or choose another folder with -o"), (True, "then --resume")):
        with (
            pytest.raises(
                DataError, match=f"out cannot be written: No space left; make room or access there, {remedy}$"
            ),
            Folder(tmp_path / "out", JOB) as folder,
        ):
            if checkpoint:
                folder.checkpoint({"level": np.arange(4.0)})
            with folder.writing():
                raise OSError(28, "No space left")
        assert partial_of(tmp_path / "out").exists() == checkpoint


def test_an_empty_folder_is_free(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with Folder(tmp_path / "out", JOB) as folder:
        made(folder)
    assert (tmp_path / "out" / "events.h5").exists()


def test_an_error_before_the_first_checkpoint_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Folder(tmp_path / "out", JOB, **COLUMNS) as folder:
        EventColumns(folder).append(events_at(1))
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_events_come_back_in_blocks(tmp_path: Path) -> None:
    with Folder(tmp_path / "out", JOB, growing=column_files(labels=True)) as folder:
        columns = EventColumns(folder, labels=True)
        for t in ((1, 2, 3), (), (4,), (5, 6, 7)):
            columns.append(events_at(*t))
        blocks = list(columns.blocks(3))
    assert [block.t.tolist() for block in blocks] == [[1, 2, 3], [4, 5, 6], [7]]
    assert all(block.label is not None and len(block.label) == len(block) for block in blocks)
    with Folder(tmp_path / "out", JOB, **COLUMNS) as folder:
        assert [len(block) for block in EventColumns(folder).blocks(3)] == [0]


def test_resuming_cuts_off_what_came_after_the_checkpoint(tmp_path: Path) -> None:
    begun(tmp_path / "out")
    with Folder(tmp_path / "out", JOB, resume=True, **COLUMNS) as folder:
        columns = EventColumns(folder)
        assert columns.count == 2
        np.testing.assert_array_equal(folder.saved()["level"], np.arange(4.0))
        columns.append(events_at(8))
        (block,) = columns.blocks(10)
        assert block.t.tolist() == [1, 2, 8]


def test_a_begun_folder_is_neither_overwritten_nor_mixed(tmp_path: Path) -> None:
    begun(tmp_path / "out")
    before = tree(tmp_path)
    with pytest.raises(UsageError, match="--resume"), Folder(tmp_path / "out", JOB):
        pass
    with (
        pytest.raises(UsageError, match=r"threshold_on = 0\.15, not 0\.2"),
        Folder(tmp_path / "out", OTHER, resume=True),
    ):
        pass
    assert tree(tmp_path) == before
    assert begun_job(tmp_path / "out") == JOB
    with Folder(tmp_path / "out", OTHER, resume=True, overwrite=True, **COLUMNS) as folder:
        assert EventColumns(folder).count == 0 and not folder.saved()


def test_a_finished_recording_is_left_as_it_is(tmp_path: Path) -> None:
    with Folder(tmp_path / "out", JOB) as folder:
        made(folder)
    before = tree(tmp_path)
    with pytest.raises(UsageError, match="--overwrite"), Folder(tmp_path / "out", JOB):
        pass
    with Folder(tmp_path / "out", JOB, resume=True) as folder:
        assert folder.finished == JOB
    with pytest.raises(UsageError, match="threshold_on"), Folder(tmp_path / "out", OTHER, resume=True):
        pass
    assert tree(tmp_path) == before


@pytest.mark.parametrize("finished", [False, True])
@pytest.mark.parametrize("more", [{"part": [0, 3]}, {"since_ns": 5}, {"truth": {"kinds": ["depth"]}}])
def test_what_was_asked_for_in_addition_is_another_job(tmp_path: Path, more: dict[str, Any], finished: bool) -> None:
    """Not only what is asked for in addition; that a finished recording has more in it is as good."""
    for begun_with, asked in ((JOB | more, JOB), (JOB, JOB | more)):
        out = tmp_path / f"out{len(asked)}"
        with Folder(out, begun_with, **COLUMNS) as folder:
            made(folder) if finished else folder.checkpoint({"level": np.arange(4.0)})
        again = Folder(out, asked, resume=True, **COLUMNS)
        if finished and asked == JOB and "truth" in more:
            with again:
                assert again.finished
            continue
        with pytest.raises(UsageError, match=rf"was begun with {min(more)}"), again:
            pass
        with Folder(out, begun_with, resume=True, **COLUMNS) as folder:
            assert finished or folder.saved()


def test_overwriting_keeps_the_old_until_the_new_is_whole(tmp_path: Path) -> None:
    with Folder(tmp_path / "out", JOB) as folder:
        made(folder)
    before = tree(tmp_path / "out")
    with pytest.raises(ZeroDivisionError), Folder(tmp_path / "out", OTHER, overwrite=True, **COLUMNS) as folder:
        EventColumns(folder).append(events_at(1))
        raise ZeroDivisionError
    assert tree(tmp_path / "out") == before
    with Folder(tmp_path / "out", OTHER, overwrite=True) as folder:
        made(folder)
    assert begun_job(tmp_path / "out") == OTHER
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_folders_of_others_are_not_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "one.png").touch()
    (tmp_path / "file").touch()
    (tmp_path / "here").mkdir()
    (tmp_path / "shoot" / "raw").mkdir(parents=True)
    (tmp_path / "shoot" / "raw" / "000001.png").touch()
    with Folder(tmp_path / "mixed", JOB) as folder:
        made(folder)
    (tmp_path / "mixed" / "raw").mkdir()
    (tmp_path / "mixed" / "raw" / "holiday.cr2").touch()
    partial_of(tmp_path / "taken").mkdir()
    (partial_of(tmp_path / "taken") / "thesis.tex").touch()
    monkeypatch.chdir(tmp_path / "here")
    before = tree(tmp_path)
    for directory, reason in {
        tmp_path / "photos": "one.png",
        tmp_path / "file": "is a file",
        tmp_path / "shoot": "no manifest.json",
        tmp_path / "mixed": r"no recording \(raw\)",
        tmp_path / "taken": "other files",
        Path("."): "within",
        Path(".."): "within",
        tmp_path / "here": "within",
        Path("/"): "within",
    }.items():
        with pytest.raises(UsageError, match=reason):
            check_free(directory, overwrite=True, resume=True)
    assert tree(tmp_path) == before


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege there")
@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_not_replaced(tmp_path: Path, there: bool) -> None:
    if there:
        (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").symlink_to("elsewhere")
    with pytest.raises(UsageError, match="is a link"), Folder(tmp_path / "out", JOB):
        pass
    assert (tmp_path / "out").is_symlink() and not partial_of(tmp_path / "out").exists()


def test_two_at_once_are_kept_apart(tmp_path: Path) -> None:
    pytest.importorskip("fcntl", reason="no file locks on this system")
    with Folder(tmp_path / "out", JOB, **COLUMNS) as first:
        EventColumns(first).append(events_at(1))
        for flags in ({}, {"overwrite": True}, {"resume": True}):
            with pytest.raises(UsageError, match="another vid2ev"), Folder(tmp_path / "out", JOB, **flags):
                pass
        made(first)
    assert (tmp_path / "out" / "events.h5").exists()


def test_a_lock_that_was_removed_since_it_was_opened_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl", reason="no file locks on this system")
    flock, third, removed = fcntl.flock, Held(tmp_path / "out"), tmp_path / "out" / "lock"

    def late(handle: int, flags: int) -> None:
        """As if another process had ended, and a third begun, between the opening of the lock and this."""
        monkeypatch.setattr(fcntl, "flock", flock)
        removed.unlink()
        third.take()
        flock(handle, flags)

    (tmp_path / "out").mkdir()
    monkeypatch.setattr(fcntl, "flock", late)
    with pytest.raises(UsageError, match="another vid2ev"), Held(tmp_path / "out"):
        pass
    third.close()
    with Held(tmp_path / "out"):
        pass


def test_who_is_asked_to_end_while_it_begins_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl", reason="no file locks on this system")
    flock = fcntl.flock

    def asked(handle: int, flags: int) -> None:
        flock(handle, flags)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(fcntl, "flock", asked)
    with pytest.raises(KeyboardInterrupt), whole(tmp_path / "film.mp4") as made:
        made.touch()
    with pytest.raises(KeyboardInterrupt), Folder(tmp_path / "out", JOB):
        pass
    assert not list(tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)  # (it is heard again)


def test_who_asks_twice_to_end_leaves_nothing_of_what_was_to_be_whole(
    tmp_path: Path, asks_again: Callable[[], None]
) -> None:
    """The second time while it is cleared up."""
    asks_again()
    with pytest.raises(KeyboardInterrupt), whole(tmp_path / "scene") as made:
        made.mkdir()
        (made / "000000.png").touch()
        raise KeyboardInterrupt
    assert not any(tmp_path.iterdir())


def test_of_a_lock_nothing_is_left_and_that_of_others_stays(tmp_path: Path) -> None:
    with Held(tmp_path):
        pass
    assert not list(tmp_path.iterdir())
    pytest.importorskip("fcntl", reason="no file locks on this system")
    with Held(tmp_path) as held:
        (tmp_path / "lock").unlink()
        with Held(tmp_path):
            held.close()
            with pytest.raises(UsageError, match="another vid2ev"), Held(tmp_path):
                pass


def test_a_folder_that_was_made_to_be_held_is_gone_if_nothing_came_into_it(tmp_path: Path) -> None:
    with Held(tmp_path / "a" / "mine"):
        pass
    assert [path.name for path in tmp_path.rglob("*")] == ["a"]
    with Held(tmp_path / "a"):  # (which was there)
        pass
    with Held(tmp_path / "b"):
        (tmp_path / "b" / "file").touch()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "b", "file"]


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DataError, match="file/out cannot be written"), Folder(tmp_path / "file" / "out", JOB):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
