"""Standard input and cameras: read once, as their frames are taken."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from vid2ev import convert
from vid2ev.commands import main
from vid2ev.errors import DataError, UsageError
from vid2ev.sources import live, open_source, short_name
from vid2ev.tracks.recorder import Progress

ROOT = Path(__file__).parents[2]


class Piped:
    """What stands in for sys.stdin: bytes that cannot be read twice, and how many were read."""

    def __init__(self, data: bytes, terminal: bool = False):
        self.buffer, self.taken, self._data, self._terminal = self, 0, io.BytesIO(data), terminal

    def isatty(self) -> bool:
        return self._terminal

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return False

    def read(self, size: int = -1) -> bytes:
        data = self._data.read(size)
        self.taken += len(data)
        return data


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Piped]:
    def pipe(data: bytes, terminal: bool = False) -> Piped:
        piped = Piped(data, terminal)
        monkeypatch.setattr(sys, "stdin", piped)
        return piped

    return pipe


def noise(count: int, shape: tuple[int, int] = (48, 64)) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    return [rng.integers(0, 256, shape).astype(np.uint8) for _ in range(count)]


def y4m(pictures: list[np.ndarray], fps: int = 25) -> bytes:
    height, width = pictures[0].shape
    head = f"YUV4MPEG2 W{width} H{height} F{fps}:1 Ip A1:1 Cmono\n".encode()
    return head + b"".join(b"FRAME\n" + picture.tobytes() for picture in pictures)


FRAGMENTED = {"movflags": "frag_keyframe+empty_moov"}


@pytest.mark.parametrize(("name", "codec", "container_options"), [
    ("a.mkv", "ffv1", {}), ("a.ts", "libx264", {}), ("a.mp4", "libx264", FRAGMENTED),
    ("a.mp4", "libx264", {"movflags": "faststart"}), ("a.nut", "ffv1", {}),
])  # fmt: skip
def test_a_pipe_gives_what_the_file_gives(encode, pipe, name: str, codec: str, container_options) -> None:
    path = encode(name, noise(12), codec=codec, container_options=container_options, time_base=Fraction(1, 30))
    whole = list(open_source(path).frames())
    pipe(path.read_bytes())
    source = open_source("-")
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [frame.t_ns for frame in whole]
    for a, b in zip(frames, whole, strict=True):
        np.testing.assert_array_equal(a.light, b.light)


def test_y4m(pipe) -> None:
    pictures = noise(7)
    pipe(y4m(pictures))
    source = open_source("-", transfer="linear")
    assert source.size == (64, 48) and not source.rewindable and source.duration_expected_s is None
    about = source.describe()
    assert about["kind"] == "pipe" and about["size"] == [64, 48] and about["codec"] == "rawvideo"
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [40_000_000 * k for k in range(7)]
    steps = np.unique(np.round([frame.light.mean() for frame in frames], 5))
    assert steps.size == 7
    assert source.describe() == about


def test_of_a_conversion_that_cannot_be_taken_up_nothing_is_left(pipe, tmp_path: Path) -> None:
    """Nobody can go on with what passes once, wherever it is interrupted; and the next one finds the place free."""
    options = {"upsample": "none", "threads": 1, "preview": False}

    def interrupted(_: object, done: Progress) -> None:
        if done.frames == 5:
            raise KeyboardInterrupt

    pipe(y4m(noise(7)))
    with pytest.raises(KeyboardInterrupt):
        convert("-", tmp_path / "out", "ideal", piece=1, report=interrupted, **options)
    assert not [*tmp_path.iterdir()]
    pipe(y4m(noise(7)))
    manifest = convert("-", tmp_path / "out", "ideal", piece=1, **options)
    pipe(y4m(noise(7)))
    assert convert("-", tmp_path / "whole", "ideal", **options)["counts"] == manifest["counts"]
    made, whole = (tmp_path / name / "events.h5" for name in ("out", "whole"))
    assert made.read_bytes() == whole.read_bytes() and {*tmp_path.iterdir()} == {made.parent, whole.parent}


def test_event_files_of_a_pipe_are_said_to_have_no_frames(pipe, tmp_path: Path) -> None:
    for formats, said in (("aedat4,hdf5", ["aedat4: without the frames beside the events"]), ("hdf5", [])):
        pipe(y4m(noise(3)))
        warnings = convert("-", tmp_path / formats, "ideal", formats=formats, upsample="none", preview=False)[
            "warnings"
        ]
        assert [text.partition(", as")[0] for text in warnings if "frames beside" in text] == said


def test_a_second_time_is_refused(pipe) -> None:
    pipe(y4m(noise(3)))
    source = open_source("-")
    assert len(list(source.frames())) == 3
    with pytest.raises(UsageError, match="standard input: can be read once only"):
        next(source.frames())


@pytest.mark.parametrize("size", [(48, 64), (600, 800)])
def test_a_pipe_is_opened_again_until_frames_were_taken_of_it(pipe, size: tuple[int, int]) -> None:
    """As who looks at a video first and converts it then does."""
    pipe(y4m(noise(12, size)))
    looked = [open_source("-") for _ in range(3)]
    frames = list(looked[-1].frames())
    assert [frame.t_ns for frame in frames] == [40_000_000 * k for k in range(12)]
    with pytest.raises(UsageError, match="standard input: can be read once only"):
        open_source("-")
    pipe(y4m(noise(5)))
    assert len(list(open_source("-").frames())) == 5


def test_a_pipe_is_converted_for_who_wants_to_be_told_first(tmp_path: Path) -> None:
    common = ["convert", "-", "--sensor", "ideal", "--upsample", "none", "--threads", "1", "--no-preview"]
    events = []
    for more in ([], ["--verbose"]):
        output = tmp_path / f"out{len(more)}"
        done = CliRunner().invoke(main, [*common, "-o", str(output), *more], input=y4m(noise(7)))
        assert done.exit_code == 0, done.output
        events.append((output / "events.h5").read_bytes())
    assert events[0] == events[1]


def test_a_pipe_is_read_again_by_who_wants_it_in_time(pipe) -> None:
    pipe(y4m(noise(30)))
    source = open_source("-", transfer="linear", start=0.2, crop="32x24")
    assert source.kept
    source.kept.wanted = True
    first, again = list(source.frames()), list(source.frames())
    source.kept.wanted = False
    last = list(source.frames(3))
    assert len(first) == 25 and len(last) == 22
    for one, other in [*zip(first, again, strict=True), *zip(first[3:], last, strict=True)]:
        assert one.t_ns == other.t_ns
        np.testing.assert_array_equal(one.light, other.light)


def test_a_pipe_is_read_no_faster_than_its_frames_are_taken(pipe) -> None:
    pictures = noise(400, (120, 160))
    data = y4m(pictures)
    piped = pipe(data)
    frames = open_source("-").frames()
    next(frames)
    first = piped.taken
    for _ in range(100):
        next(frames)
    assert first < len(data) / 8
    assert piped.taken - first < len(data) * 130 / 400


def test_edits_of_a_pipe(pipe) -> None:
    pictures = noise(20)
    options = dict(start=0.2, stop=0.5, slowdown=2, crop="32x24", size="16", transfer="linear")
    pipe(y4m(pictures))
    source = open_source("-", **options)
    assert source.size == (16, 12) and source.duration_expected_s == pytest.approx(0.15)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [k * 20_000_000 for k in range(5, 13)]
    pipe(y4m(pictures))
    with pytest.raises(DataError, match="no frame from 5 s"):
        list(open_source("-", start=5).frames())


def test_a_pipe_taken_up_again_passes_over_what_was_done(pipe) -> None:
    pipe(y4m(noise(9)))
    assert [frame.t_ns for frame in open_source("-").frames(6)] == [240_000_000, 280_000_000, 320_000_000]


@pytest.mark.parametrize(("name", "codec"), [("cut.mkv", "ffv1"), ("cut.ts", "libx264")])
def test_a_pipe_that_ends_too_early_says_so_as_a_file_does(encode, pipe, tmp_path: Path, name: str, codec: str) -> None:
    data = encode(name, noise(40), codec=codec).read_bytes()
    data = data[: len(data) // 2 // 188 * 188 + 94]
    (tmp_path / name).write_bytes(data)
    file = open_source(tmp_path / name)
    pipe(data)
    piped = open_source("-")
    assert len(list(file.frames())) == len(list(piped.frames())) < 40
    assert file.warnings == piped.warnings and any("truncated" in warning for warning in piped.warnings)


@pytest.mark.parametrize("data", [b"", b"no video at all\n" * 50, b"YUV4MPEG2 W64 H48 F25:1\n"])
def test_what_is_no_video_is_refused(pipe, data: bytes) -> None:
    pipe(data)
    with pytest.raises(DataError, match="standard input: "):
        open_source("-")


def test_a_still_avif_is_no_clip_in_a_pipe_either(pipe) -> None:
    """One that moves is, and the still beside it is not taken for it."""
    pictures = [Image.fromarray(np.full((24, 32, 3), 60 * k + 30, np.uint8)) for k in range(4)]
    content = io.BytesIO()
    pictures[0].save(content, "avif")
    pipe(content.getvalue())
    with pytest.raises(UsageError, match=r"standard input: a single picture; .*--motion"):
        open_source("-")
    content = io.BytesIO()
    pictures[0].save(content, "avif", save_all=True, append_images=pictures[1:], duration=40)
    pipe(content.getvalue())
    assert len(list(open_source("-").frames())) == 4


def test_a_cut_off_pipe_gives_what_it_has(pipe) -> None:
    data = y4m(noise(10))
    pipe(data[: len(data) * 55 // 100])
    source = open_source("-")
    assert len(list(source.frames())) == 5


def test_a_terminal_is_told_what_to_do(pipe) -> None:
    pipe(b"", terminal=True)
    with pytest.raises(UsageError, match=r"nothing is piped in.*vid2ev convert -"):
        open_source("-")


def test_a_real_pipe_makes_its_writer_wait() -> None:
    """A writer of 60 MB against a reader that takes three frames: most of it must stay unwritten."""
    program = (
        "import time\nfrom vid2ev.sources import open_source\nframes = open_source('-').frames()\n"
        "for _ in range(3):\n    next(frames)\nprint('ready', flush=True)\ntime.sleep(60)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT)
    assert child.stdin and child.stdout
    data, written = y4m(noise(1, (480, 640)) * 200), [0]

    def write() -> None:
        descriptor = child.stdin.fileno()
        try:
            while written[0] < len(data):
                written[0] += os.write(descriptor, data[written[0] : written[0] + 65536])
        except OSError:
            pass  # (the reader has been ended)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        assert child.stdout.readline() == b"ready\n"
        settled = -1
        while settled != written[0]:
            settled = written[0]
            time.sleep(0.2)
        assert settled < len(data) / 4
    finally:
        child.kill()
        child.wait()
        writer.join(10)
        child.stdin.close()
        child.stdout.close()


# ---------------------------------------------------------------------------------------------------------- cameras


@pytest.fixture
def fake_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera that is FFmpeg's test pattern; its driver counts the time from when the machine was started."""
    opened = av.open

    def open_pattern(device: str, **options: object) -> object:
        assert device == "/dev/video3" and options == {"format": "v4l2"}
        return opened("testsrc=size=64x48:rate=20,setpts=PTS+1234.5/TB", format="lavfi")

    monkeypatch.setattr(live.av, "open", open_pattern)
    monkeypatch.setattr(live.sys, "platform", "linux")


def test_a_camera_counts_from_its_first_frame_until_told_to_stop(fake_camera) -> None:
    source = open_source("camera:3", stop=0.3)
    assert source.size == (64, 48) and not source.rewindable and source.duration_expected_s == pytest.approx(0.3)
    assert source.describe()["kind"] == "camera" and source.describe()["path"] == "camera:3"
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [50_000_000 * k for k in range(7)]
    assert all(frame.light.max() > 0.5 for frame in frames)
    with pytest.raises(UsageError, match="once only"):
        next(source.frames())


def test_what_a_camera_saw_cannot_be_taken_up_again(fake_camera) -> None:
    with pytest.raises(UsageError, match="cannot be seen again"):
        next(open_source("camera:3").frames(5))


def test_no_camera_is_one_sentence() -> None:
    with pytest.raises(DataError) as refused:
        open_source("camera:/dev/no-such-camera" if sys.platform == "linux" else "camera:77")
    assert "no camera that can be opened" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(("text", "platform", "device", "form"), [
    ("0", "linux", "/dev/video0", "v4l2"), ("/dev/video7", "linux", "/dev/video7", "v4l2"),
    ("1", "darwin", "1:none", "avfoundation"), ("Integrated Camera", "win32", "video=Integrated Camera", "dshow"),
])  # fmt: skip
def test_names_of_cameras(text: str, platform: str, device: str, form: str) -> None:
    assert live.device_of(text, platform)[0] == device and live.device_of(text, platform)[1]["format"] == form


@pytest.mark.parametrize("name", ["0", "/dev/video7", "Integrated Camera"])
def test_recordings_are_called_after_their_camera_and_made_where_one_is(name: str) -> None:
    assert short_name(f"camera:{name}") == f"camera{name.removeprefix('/dev/')}"


@pytest.mark.parametrize(("text", "platform"), [("", "linux"), ("0", "win32")])
def test_cameras_that_cannot_be_meant(text: str, platform: str) -> None:
    with pytest.raises(UsageError, match=r"camera:.*expected"):
        live.device_of(text, platform)
