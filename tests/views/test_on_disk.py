"""Slices on disk: numpy, OpenCV and FFmpeg read what was written; the same bytes each time; whole or not there."""

from __future__ import annotations

import csv
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events
from vid2ev.views.on_disk import KINDS, write_frames
from vid2ev.views.representation import represent
from vid2ev.views.requests import parse_representation, parse_slicing

from .recordings import SIZE, events_at, recording_of

T = np.sort(np.random.default_rng(5).integers(0, 100_000, 4000))
RECORDING = recording_of(events_at(T), 0, 100_000, block=700, frame_us=range(0, 100_001, 25_000))
ASKED = [
    ("counts", "duration:10ms"),
    ("frame:2", "count:999"),
    ("voxel:3", "source"),
    ("time-surface:5ms", "area:50,7"),
]


def rows(path: Path) -> list[tuple[int, ...]]:
    with open(path, newline="") as file:
        header, *table = csv.reader(file)
    assert header == ["number", "start_us", "stop_us", "events"]
    return [tuple(int(value) for value in row) for row in table]


@pytest.mark.parametrize(("representation", "slicing"), ASKED)
def test_numpy_loads_all_slices(tmp_path: Path, representation: str, slicing: str) -> None:
    n = write_frames(tmp_path / "frames.npz", RECORDING, representation, slicing)
    expected = list(
        represent(RECORDING, parse_slicing(slicing), parse_representation(representation)(SIZE)),
    )
    with np.load(tmp_path / "frames.npz", allow_pickle=False) as found:
        assert n == len(expected) == len(found["frames"])
        np.testing.assert_array_equal(found["frames"], np.stack([array for _, array in expected]))
        assert found["frames"].dtype == expected[0][1].dtype
        for name in ("start_us", "stop_us", "events"):
            assert found[name].tolist() == [getattr(part, name) for part, _ in expected]
        assert found["events"].sum() == len(T)
        assert (str(found["representation"]), parse_slicing(str(found["slices"]))) == (
            representation,
            parse_slicing(slicing),
        )
    assert zipfile.ZipFile(tmp_path / "frames.npz").testzip() is None
    assert [path.name for path in tmp_path.iterdir()] == ["frames.npz"]


@pytest.mark.parametrize(("representation", "slicing"), ASKED)
def test_opencv_reads_the_pictures(tmp_path: Path, representation: str, slicing: str) -> None:
    n = write_frames(tmp_path / "frames", RECORDING, representation, slicing, kind="png")
    view = parse_representation(representation)(SIZE)
    table = rows(tmp_path / "frames" / "slices.csv")
    for k, (part, array) in enumerate(represent(RECORDING, parse_slicing(slicing), view)):
        picture = cv2.imread(str(tmp_path / "frames" / f"{k:06d}.png"), cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(picture[..., ::-1], view.picture(array))
        assert table[k] == (k, part.start_us, part.stop_us, part.events)
    assert n == len(table) == len(list((tmp_path / "frames").glob("*.png")))


def test_ffmpeg_decodes_the_film(tmp_path: Path) -> None:
    n = write_frames(tmp_path / "frames.mp4", RECORDING, "frame:2", "duration:10ms", kind="mp4", fps=25)
    content = (tmp_path / "frames.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")
    with av.open(str(tmp_path / "frames.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height, stream.average_rate) == (*SIZE, 25)
        shown = [frame.to_ndarray(format="gray").astype(float) for frame in container.decode(stream)]
    assert n == len(shown) == 10
    view = parse_representation("frame:2")(SIZE)
    for picture, (_, array) in zip(shown, represent(RECORDING, parse_slicing("duration:10ms"), view), strict=True):
        assert np.corrcoef(picture.ravel(), array.ravel())[0, 1] > 0.98
    assert [row[3] for row in rows(tmp_path / "frames.csv")] == np.histogram(T, range(0, 100_001, 10_000))[0].tolist()


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_recording_gives_the_same_bytes(tmp_path: Path, kind: str) -> None:
    def written(name: str, recording: Recording) -> dict[str, bytes]:
        folder = tmp_path / name
        folder.mkdir()
        write_frames(folder / KINDS[kind], recording, kind=kind)
        return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}

    other_blocks = recording_of(events_at(T), 0, 100_000, block=33)
    assert written("one", RECORDING) == written("other", other_blocks)


@pytest.mark.parametrize("kind", KINDS)
def test_what_goes_wrong_leaves_what_was_there(tmp_path: Path, kind: str) -> None:
    def damaged() -> Iterator[Events]:
        yield events_at(T[:2000])
        raise DataError("events.h5 is damaged")

    path = tmp_path / KINDS[kind]
    broken = replace(RECORDING, blocks=damaged)
    with pytest.raises(DataError):
        write_frames(path, broken, kind=kind)
    assert list(tmp_path.iterdir()) == []
    write_frames(path, RECORDING, kind=kind)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    with pytest.raises(DataError):
        write_frames(path, broken, kind=kind)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before
    write_frames(path, RECORDING, "frame", "count:1000", kind=kind)  # the new takes the place of the old
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} != before
    assert not any(".new" in str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*"))


def test_a_folder_of_another_aside_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "frames.npz.new").mkdir()
    (tmp_path / "frames.npz.new" / "notes.txt").write_text("mine")
    write_frames(tmp_path / "frames.npz", RECORDING)
    assert (tmp_path / "frames.npz.new" / "notes.txt").read_text() == "mine"


def test_requests_that_cannot_be_meant_touch_nothing(tmp_path: Path) -> None:
    path = tmp_path / "frames.npz"
    for options in ({"kind": "gif"}, {"representation": "cubes"}, {"slicing": "often"}):
        with pytest.raises(UsageError):
            write_frames(path, RECORDING, **options)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="frames"):
        write_frames(path, replace(RECORDING, frame_us=None), slicing="source")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    program = """
import resource, sys
from pathlib import Path
import numpy as np
from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events
from vid2ev.views.on_disk import KINDS, write_frames
random = np.random.default_rng(0)
n = 1 << 18
t = np.sort(random.integers(0, 10**6, n))
x = random.integers(0, 300, n).astype(np.uint16)
events = Events(t, x, x[::-1].copy(), (x & 1).astype(np.uint8))
recording = Recording((300, 300), 0, 10**6, n, lambda: iter([events]))
for kind in KINDS:  # compiles
    write_frames(Path(sys.argv[1]) / "first" / KINDS[kind], recording, kind=kind)
for limit in (0, 100, 5000, 50_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    for kind in KINDS:
        try:
            write_frames(Path(sys.argv[1]) / KINDS[kind], recording, kind=kind)
        except OSError as error:
            print(kind, end=" ")
"""
    (tmp_path / "first").mkdir()
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split()[:9] == ["npz", "png", "mp4"] * 3
    assert not any(".new" in path.name for path in tmp_path.rglob("*"))


def test_every_slice_is_reported(tmp_path: Path) -> None:
    for kind in KINDS:
        seen: list[int] = []
        write_frames(
            tmp_path / KINDS[kind], RECORDING, kind=kind, report=lambda part, seen=seen: seen.append(part.events)
        )
        assert sum(seen) == len(T) and len(seen) == 10
