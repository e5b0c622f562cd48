"""A run that is killed goes on to the same bytes, and nothing is there before all is."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from forked import forks_of
from small_takes import images, moving, recording

from interp.interpolate import shelf
from interp.interpolate.whole import interpolate
from interp.networks import make
from interp.weights import save
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.exposures import write_codes
from vid2ev.recording.held import Held

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")]

WARM = """
import torch
torch.set_num_threads(1)
from interp.interpolate import shelf
from interp.interpolate.whole import interpolate
"""
RUN = """
import os, signal, sys
from interp.interpolate import shelf
from interp.interpolate.whole import interpolate

shelf.PIECE = 8
last = int(sys.argv[3])

def report(done, total):
    if done == last:
        os.kill(os.getpid(), signal.SIGKILL)

interpolate(sys.argv[1], sys.argv[2], multiple=3, report=report)
"""


def killed(source: Path, output: Path, at: int) -> None:
    done = forks_of(WARM).run(RUN, str(source), str(output), str(at))
    assert done.returncode == -signal.SIGKILL, done.stderr


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "frames.json"}


def decoded(film: Path) -> list[np.ndarray]:
    with av.open(str(film)) as container:
        return [frame.to_ndarray() for frame in container.decode(video=0)]


@pytest.mark.parametrize("at", [1, 3, 11])
def test_a_folder_goes_on_to_the_same_bytes(tmp_path: Path, at: int) -> None:
    source = recording(tmp_path / "in", moving(6))
    interpolate(source, tmp_path / "once", multiple=3)
    killed(source, tmp_path / "twice", at)
    assert not (tmp_path / "twice").exists() and (tmp_path / "twice.partial").exists()
    if at > 3:
        with pytest.raises(UsageError, match="--resume continues it"):
            interpolate(source, tmp_path / "twice", multiple=3)
        with pytest.raises(UsageError, match="begun with grid"):
            interpolate(source, tmp_path / "twice", multiple=4, resume=True)
    counted: list[int] = []
    interpolate(source, tmp_path / "twice", multiple=3, resume=True, report=lambda done, _: counted.append(done))
    assert counted[0] == at // 3 * 3 - (3 if at % 3 == 0 else 0)  # (a stretch of three frames is done with its line)
    assert bytes_of(tmp_path / "once") == bytes_of(tmp_path / "twice")
    assert not (tmp_path / "twice.partial").exists()


def test_what_is_another_sequence_by_now_is_not_gone_on_with(tmp_path: Path) -> None:
    """The files of these layouts lie in folders of their folder."""
    source = recording(tmp_path / "in", moving(3))
    interpolate(source, tmp_path / "out", multiple=2, method="linear")
    write_codes(source / "images_corrected" / "000001.png", moving(3, seed=1)[1])
    with pytest.raises(UsageError, match=r"source\.identity"):
        interpolate(source, tmp_path / "out", multiple=2, method="linear", resume=True)


def test_a_film_goes_on_to_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shelf, "PIECE", 8)
    source = recording(tmp_path / "in", moving(9))
    interpolate(source, tmp_path / "once.mp4", multiple=3)
    killed(source, tmp_path / "twice.mp4", 20)
    partial = tmp_path / "twice.mp4.partial"
    assert len(list((partial / "pieces").iterdir())) == 2  # of nine frames each, which are no longer there as PNG
    assert not (tmp_path / "twice.mp4").exists()
    interpolate(source, tmp_path / "twice.mp4", multiple=3, resume=True)
    assert (tmp_path / "once.mp4").read_bytes() == (tmp_path / "twice.mp4").read_bytes()
    assert len(decoded(tmp_path / "twice.mp4")) == 25
    assert not partial.exists()


def test_a_film_has_its_last_frame_though_all_others_are_in_pieces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pieces of eight frames, and the last key frame alone."""
    monkeypatch.setattr(shelf, "PIECE", 7)
    told = interpolate(images(tmp_path / "in", moving(3)), tmp_path / "film.mp4", multiple=4, method="linear")
    assert told["frames"] == len(decoded(tmp_path / "film.mp4")) == 9


def test_what_was_cut_off_in_writing_does_not_count(tmp_path: Path) -> None:
    source = recording(tmp_path / "in", moving(6))
    interpolate(source, tmp_path / "once", multiple=3)
    killed(source, tmp_path / "twice", 11)
    partial = tmp_path / "twice.partial"
    with open(partial / "done.jsonl", "a") as journal:
        journal.write('{"key_us": 1, "t_us": [')
    (partial / "frames" / "new.png").write_bytes(b"half a picture")
    interpolate(source, tmp_path / "twice", multiple=3, resume=True)
    assert bytes_of(tmp_path / "once") == bytes_of(tmp_path / "twice")


def test_a_full_disk_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source, left = images(tmp_path / "in", moving(4)), iter(range(8))

    def nearly_full(path: Path) -> None:
        if next(left, None) is None:
            raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(shelf, "sync", nearly_full)
        with pytest.raises(DataError, match=r"No space left on device; make room or access there, then --resume$"):
            interpolate(source, tmp_path / "out", multiple=3, method="linear")
    assert interpolate(source, tmp_path / "out", multiple=3, method="linear", resume=True)["frames"] == 10


def test_what_is_missing_of_what_was_made_is_named_and_nothing_is_published(tmp_path: Path) -> None:
    source = recording(tmp_path / "in", moving(6))
    killed(source, tmp_path / "out", 11)
    (tmp_path / "out.partial" / "frames" / "000002.png").unlink()
    for _ in range(2):
        with pytest.raises(DataError, match=r"000002\.png is not there any more; --overwrite starts again"):
            interpolate(source, tmp_path / "out", multiple=3, resume=True)
    assert not (tmp_path / "out").exists() and (tmp_path / "out.partial" / "frames" / "000003.png").exists()
    assert interpolate(source, tmp_path / "out", multiple=3, overwrite=True)["frames"] == 16


@pytest.mark.parametrize("piece", [0, 1])
def test_a_piece_of_a_film_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: int
) -> None:
    monkeypatch.setattr(shelf, "PIECE", 8)
    source = recording(tmp_path / "in", moving(9))
    killed(source, tmp_path / "out.mp4", 20)
    sorted((tmp_path / "out.mp4.partial" / "pieces").iterdir())[piece].unlink()
    with pytest.raises(DataError, match=["frames 9 to 17 of 18 after the first 0", "000009.png is not there"][piece]):
        interpolate(source, tmp_path / "out.mp4", multiple=3, resume=True)
    assert not (tmp_path / "out.mp4").exists()


@pytest.mark.parametrize("moment", ["publish", "put_in_place"])
def test_killed_when_all_is_made_nothing_is_made_twice(
    tmp_path: Path, moment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The instant after the last frame is done is one like all others; what is replaced stays until then."""
    source = recording(tmp_path / "in", moving(4))
    interpolate(source, tmp_path / "once", multiple=3)
    interpolate(source, tmp_path / "twice", multiple=2)
    old = bytes_of(tmp_path / "twice")

    def kill(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(shelf.Shelf if moment == "publish" else shelf, moment, kill)
        interpolate(source, tmp_path / "twice", multiple=3, overwrite=True)
    assert bytes_of(tmp_path / "twice") == old
    told = interpolate(source, tmp_path / "twice", multiple=3, overwrite=True, resume=True)
    assert told["frames"] == 10 and bytes_of(tmp_path / "once") == bytes_of(tmp_path / "twice")
    assert not (tmp_path / "twice.partial").exists()


@pytest.mark.parametrize("name", ["out", "out.mp4"])
def test_killed_while_it_is_put_in_place_it_is_there_or_goes_on(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = recording(tmp_path / "in", moving(3))
    interpolate(source, tmp_path / f"once{Path(name).suffix}", multiple=2)

    class Killed(Exception):
        pass

    def kill(*_: object) -> None:
        raise Killed

    for moment in ("before", "after"):
        with monkeypatch.context() as patched:
            if moment == "before":
                patched.setattr(os, "replace", kill)
                patched.setattr(Path, "rename", kill)
            else:
                patched.setattr(shelf.shutil, "rmtree", lambda *_, **__: None)
                patched.setattr(Held, "close", lambda held: os.close(held._handle))  # (what the system does)
            if moment == "before":
                patched.setattr(shelf, "join_films", kill)
                with pytest.raises(Killed):
                    interpolate(source, tmp_path / name, multiple=2)
                assert not (tmp_path / name).exists()
            else:
                interpolate(source, tmp_path / name, multiple=2, resume=True)
                assert (tmp_path / f"{name}.partial").exists()
        told = interpolate(source, tmp_path / name, multiple=2, resume=True)
        assert told["frames"] == 5
    once = tmp_path / f"once{Path(name).suffix}"
    if name == "out":
        assert bytes_of(once) == bytes_of(tmp_path / name)
    else:
        assert once.read_bytes() == (tmp_path / name).read_bytes()


class Stopped(Exception):
    pass


def stopped_at(last: int) -> Any:
    def report(done: int, _: int | None) -> None:
        if done == last:
            raise Stopped

    return report


@pytest.mark.parametrize(
    ("option", "name", "settings"),
    [
        ("network", "firenet", {}),
        ("hdr", "hdr", {}),
        ("hdr", "hdr", {"colours": 1}),
        ("hdr", "hdr", {"second": "frames"}),
    ],
)
@pytest.mark.parametrize("at", [5, 11])
def test_what_remembers_goes_on_with_what_it_knew(
    tmp_path: Path, option: str, name: str, settings: dict[str, Any], at: int
) -> None:
    save(tmp_path / "some.safetensors", name, make(name, **settings))
    source = recording(tmp_path / "in", [*moving(3, seed=1), *moving(3, seed=2)])
    given: dict[str, Any] = {"multiple": "2.5", option: tmp_path / "some.safetensors"}
    interpolate(source, tmp_path / "once", **given)
    with pytest.raises(Stopped):
        interpolate(source, tmp_path / "twice", report=stopped_at(at), **given)
    interpolate(source, tmp_path / "twice", resume=True, **given)
    assert bytes_of(tmp_path / "once") == bytes_of(tmp_path / "twice")


def test_what_was_remembered_and_is_missing_is_named(tmp_path: Path) -> None:
    save(tmp_path / "net.safetensors", "firenet", make("firenet"))
    source = recording(tmp_path / "in", moving(4))
    given: dict[str, Any] = {"multiple": 2, "network": tmp_path / "net.safetensors"}
    with pytest.raises(Stopped):
        interpolate(source, tmp_path / "out", report=stopped_at(5), **given)
    (kept,) = (tmp_path / "out.partial").glob("memory-*.npz")
    kept.unlink()
    with pytest.raises(DataError, match=rf"{kept.name} cannot be read .*--overwrite starts again"):
        interpolate(source, tmp_path / "out", resume=True, **given)


def test_only_what_does_not_fit_is_said_not_to(tmp_path: Path) -> None:
    save(tmp_path / "net.safetensors", "firenet", make("firenet"))
    source = recording(tmp_path / "in", moving(4))
    given: dict[str, Any] = {"multiple": 2, "network": tmp_path / "net.safetensors", "resume": True}

    def failed(done: int, _: int | None) -> None:
        if done == 5:
            raise LookupError("whoever is told")

    for _ in range(2):  # (also in the first stretch of which something is remembered)
        with pytest.raises(LookupError, match="whoever is told"):
            interpolate(source, tmp_path / "out", report=failed, **given)
    (kept,) = (tmp_path / "out.partial").glob("memory-*.npz")
    with np.load(kept) as found:
        arrays = {name: each[..., 1:] if each.ndim > 1 else each for name, each in found.items()}
    np.savez(kept, **arrays)
    with pytest.raises(DataError, match=rf"{kept.name} does not fit what is asked for .*--overwrite starts again"):
        interpolate(source, tmp_path / "out", **given)


def test_what_was_begun_on_another_device_is_not_gone_on_with(tmp_path: Path) -> None:
    source = images(tmp_path / "in", moving(4))
    with pytest.raises(Stopped):
        interpolate(source, tmp_path / "out", multiple=2, report=stopped_at(5))
    job = tmp_path / "out.partial" / "job.json"
    job.write_text(json.dumps(json.loads(job.read_text()) | {"device": "cuda"}))
    with pytest.raises(UsageError, match='begun with device = "cuda", not "cpu"; --resume needs the options'):
        interpolate(source, tmp_path / "out", multiple=2, resume=True)


def test_after_a_cut_nothing_is_remembered(tmp_path: Path) -> None:
    save(tmp_path / "hdr.safetensors", "hdr", make("hdr", second="frames"))
    first, second = moving(4, seed=1), moving(4, seed=2)
    given: dict[str, Any] = {"multiple": 2, "hdr": tmp_path / "hdr.safetensors", "method": "linear"}
    told = interpolate(images(tmp_path / "both", [*first, *second]), tmp_path / "all", **given)
    assert list(told["gaps_s"]) == ["a cut"]
    interpolate(images(tmp_path / "one", second), tmp_path / "rest", **given)
    alone = [(tmp_path / "rest" / f"{k:06d}.png").read_bytes() for k in range(7)]
    assert [(tmp_path / "all" / f"{k + 8:06d}.png").read_bytes() for k in range(7)] == alone


@pytest.mark.parametrize("name", ["made", "made.mp4"])
@pytest.mark.parametrize("kind", [recording, images])
def test_what_is_made_within_its_own_source_is_no_part_of_it(tmp_path: Path, kind: Any, name: str) -> None:
    source = kind(tmp_path / "source", moving(4))
    output = source / name

    def interrupt(done: int, _: int | None) -> None:
        if done >= 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interpolate(source, output, multiple=3, report=interrupt)
    assert output.with_name(f"{name}.partial").is_dir()
    made = interpolate(source, output, multiple=3, resume=True)
    assert made["frames"] == 10 and made["run"]["frames"] < 10
    assert interpolate(source, output, multiple=3, resume=True) == made  # what is finished is left as it is
    with pytest.raises(UsageError, match=r"was begun with grid.multiple = .3., not .2."):
        interpolate(source, output, multiple=2, resume=True)
    left = next(iter(sorted(source.rglob("*.png"))))
    left.write_bytes(left.read_bytes() + b" ")
    with pytest.raises(UsageError, match=r"was begun with source\.identity"):
        interpolate(source, output, multiple=3, resume=True)
