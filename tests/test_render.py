"""`vid2ev render`: every event is shown once, where and when it should; failures are a sentence and leave nothing."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev import convert
from vid2ev.commands.render import render as command
from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import BLOCK, Picture, Recording, within
from vid2ev.formats.hdf5 import write_events
from vid2ev.pictures.colours import GROUND, OFF, ON, in_8_bits
from vid2ev.reformat import reformat
from vid2ev.stream.events import Events
from vid2ev.views import canvas
from vid2ev.views import render as rendering

SIZE = (32, 24)
AMBER, BLUE, DARK = (in_8_bits(colour).astype(int) for colour in (ON, OFF, GROUND))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def render(*arguments: str) -> dict[str, Any]:
    result = CliRunner().invoke(command, [*arguments, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def refused(kind: type[Exception], sentence: str, *arguments: str) -> None:
    before = sorted(Path().rglob("*"))
    with pytest.raises(kind, match=sentence) as raised:
        CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert "\n" not in str(raised.value)
    assert sorted(Path().rglob("*")) == before


def events_of(t: Any, x: Any, y: Any, p: Any) -> Events:
    t = np.asarray(t, np.int64)
    x, y = (np.broadcast_to(np.asarray(side, np.uint16), t.shape) for side in (x, y))
    return Events(t, x, y, np.broadcast_to(np.asarray(p, np.uint8), t.shape))


def write(events: Events, path: str = "events.h5", size: tuple[int, int] = SIZE, start_us: int = 0) -> str:
    Path(path).parent.mkdir(exist_ok=True)
    last_us = int(events.t[-1]) if len(events) else start_us
    write_events(Path(path), Recording(size, start_us, last_us - start_us, len(events), lambda: iter([events])))
    return path


def scattered(n: int = 600, duration_us: int = 1_000_000, start_us: int = 0) -> Events:
    """Events at pixels of their own: that of event k is (k mod 32, k div 32)."""
    k = np.arange(n)
    t = start_us + np.sort(np.random.default_rng(1).integers(0, duration_us + 1, n))
    return events_of(t, k % SIZE[0], k // SIZE[0], k % 2)


def film(path: str) -> list[np.ndarray]:
    with av.open(path) as container:
        return [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]


def picture(path: str | Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_COLOR)[..., ::-1].astype(int)


def lit(shown: np.ndarray, enlarged: int, size: tuple[int, int] = SIZE) -> dict[tuple[int, int], int]:
    """The pixels that are not dark, and whether they are amber (1) or blue (0)."""
    middles = shown[enlarged // 2 :: enlarged, enlarged // 2 :: enlarged][: size[1], : size[0]]
    there = np.argwhere(np.abs(middles - DARK).max(axis=2) > 60)
    return {(int(x), int(y)): int(middles[y, x, 0] > middles[y, x, 2]) for y, x in there}


# ----------------------------------------------------------------------------------------------------- what is shown


@pytest.mark.parametrize(
    "options", [[], ["--fps", "20"], ["--speed", "0.5"], ["--by", "count:70"], ["--by", "duration:0.04"]]
)
def test_every_event_is_in_one_picture_of_the_film(options: list[str]) -> None:
    events = scattered()
    made = render(write(events), "-o", "film.mp4", "--size", "320", *options)
    frames = film("film.mp4")
    assert made["frames"] == made["slices"] == len(frames) and made["events"] == len(events)
    assert made["size"] == [frames[0].shape[1], frames[0].shape[0]] == [320, 270]
    found = [pixel for shown in frames for pixel in lit(shown, 10).items()]
    assert sorted(found) == sorted(((k % 32, k // 32), k % 2) for k in range(len(events)))


def test_pictures_come_when_the_film_should_show_them() -> None:
    t = [100_000, 200_000, 200_001, 900_000]
    write(events_of(t, [1, 2, 3, 4], 5, 1))
    for fps, speed in ((10, 1.0), (10, 0.5), (20, 0.5), (25, 2.0)):
        made = render(
            "events.h5", "-o", "film.mp4", "--fps", str(fps), "--speed", str(speed), "--overwrite", "--size", "320"
        )
        shown = [sorted(lit(frame, 10)) for frame in film("film.mp4")]
        each_us = 1e6 * speed / fps
        when = [next(k for k, pixels in enumerate(shown) if (x, 5) in pixels) for x in (1, 2, 3, 4)]
        assert when == [int(np.ceil(at / each_us)) - 1 for at in t]
        assert made["duration_us"] == len(shown) * each_us


def test_any_rate_makes_a_film() -> None:
    write(scattered(duration_us=100_000))
    for fps in ("29.97", "12.345678901234", "1000", "0.01"):
        made = render("events.h5", "-o", "film.mp4", "--fps", fps, "--overwrite", "--size", "64")
        assert len(film("film.mp4")) == made["frames"] == int(np.ceil(0.1 * float(fps)))
        with av.open("film.mp4") as container:
            assert float(container.streams.video[0].average_rate or fps) == pytest.approx(float(fps), rel=1e-4)


def test_a_folder_has_the_pictures_of_the_film_and_their_times() -> None:
    made = render(write(scattered()), "-o", "pictures", "--by", "duration:0.1", "--no-stamp")
    with open("pictures/slices.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == made["frames"] == 10
    assert [(row["start_us"], row["stop_us"]) for row in table] == [
        (str(k * 10**5), str(k * 10**5 + 10**5)) for k in range(10)
    ]
    assert sum(int(row["events"]) for row in table) == 600
    found = [len(lit(picture(f"pictures/{k:06d}.png"), 40)) for k in range(10)]
    assert found == [int(row["events"]) for row in table]


def test_a_picture_is_the_densest_slice() -> None:
    busy = events_of(300_000 + 1 + np.arange(100), np.arange(100) % 32, np.arange(100) // 32, 0)
    write(Events.concatenate([events_of([0, 100_000], 20, 20, 1), busy, events_of([900_000], 21, 21, 1)]))
    made = render("events.h5", "-o", "a.png", "--by", "duration:100ms")
    assert (made["events"], made["start_us"], made["duration_us"], made["frames"]) == (100, 300_000, 100_000, 1)
    slower = render("events.h5", "-o", "b.png", "--speed", "3", "--start", "0", "--stop", "0.8")  # (3 / 30 s)
    assert [slower[key] for key in ("events", "start_us", "duration_us")] == [100, 300_000, 100_000]
    assert sorted(lit(picture("a.png"), 40)) == sorted((k % 32, k // 32) for k in range(100))


def test_a_picture_of_a_window_has_all_of_it() -> None:
    made = render(write(scattered()), "-o", "a.png", "--start", "0.25", "--stop", "0.5")
    t = scattered().t
    inside = np.flatnonzero((t >= 250_000) & (t <= 500_000))
    assert made["events"] == len(inside)
    assert sorted(lit(picture("a.png"), 40)) == sorted((k % 32, k // 32) for k in inside.tolist())


def test_windows_have_both_ends_in_and_count_from_the_beginning() -> None:
    start_us = 7_000_000_000
    write(events_of(start_us + np.array([0, 10_000, 20_000, 20_001, 30_000]), [1, 2, 3, 4, 5], 5, 1), start_us=start_us)
    made = render("events.h5", "-o", "a.png", "--start", "0.01", "--stop", "0.02")
    assert sorted(lit(picture("a.png"), 40)) == [(2, 5), (3, 5)] and made["start_us"] == start_us + 10_000
    made = render("events.h5", "-o", "b.png", "--stop", "0.02", "--by", "count:10")
    assert made["events"] == 3


def test_a_silence_before_the_first_event_is_left_out_where_nothing_says_when_the_file_begins() -> None:
    write(events_of([5_000_000_000, 5_000_050_000], 3, 3, 1))
    made = render("events.h5", "-o", "film.mp4")
    assert (made["start_us"], made["frames"], made["events"]) == (5_000_000_000, 2, 2)


@pytest.mark.parametrize(("first_us", "begins_us"), [(60_000, 0), (399_001, 399_001)])
def test_a_short_recording_that_says_no_beginning_begins_with_its_first_event(first_us: int, begins_us: int) -> None:
    """Such as the events of one exposure; not where it may have been still for a moment."""
    np.savez("a.npz", t=[first_us, first_us + 5000], x=[1, 2], y=[3, 4], p=[0, 1])
    assert render("a.npz", "-o", "film.mp4", "--by", "duration:1ms")["start_us"] == begins_us
    np.savez("b.npz", t=[first_us, first_us + 5000], x=[1, 2], y=[3, 4], p=[0, 1], start_us=0)
    assert render("b.npz", "-o", "said.mp4", "--by", "duration:1ms")["start_us"] == 0


def test_seconds_are_said_without_powers_of_ten() -> None:
    write(scattered())
    long = ["events.h5", "-o", "a.png", "--by", "duration:1e9s"]
    assert "600 in 1000000000 s\n" in CliRunner().invoke(command, long, catch_exceptions=False).stdout


def test_folders_of_recordings_and_defaults() -> None:
    write(scattered(), "clip_events/events.h5")
    assert render("clip_events")["path"] == "clip_events.mp4"
    assert render("clip_events/events.h5")["path"] == "events.mp4"
    shown = CliRunner().invoke(command, ["clip_events", "-o", "new/deep/a.png"], catch_exceptions=False)
    assert "a.png" in shown.stdout and "events" in shown.stdout and Path("new/deep/a.png").exists()
    assert "polarity by duration:33.3333ms" in shown.stdout
    shown = CliRunner().invoke(command, ["clip_events", "-o", "c.png", "--by", "duration:20ms"], catch_exceptions=False)
    assert "polarity by duration:20000us" in shown.stdout
    exact = ["--speed", "0.12345678901234567"]  # (more digits than --by takes)
    shown = CliRunner().invoke(command, ["clip_events", "-o", "d.png", *exact], catch_exceptions=False)
    assert "polarity by duration:4.11523ms" in shown.stdout
    assert CliRunner().invoke(command, ["clip_events", "-o", "b.png", "-q"], catch_exceptions=False).stdout == ""


def test_a_recording_without_events_is_dark() -> None:
    assert render(write(events_of([], [], [], [])), "-o", "film.mp4")["frames"] == 1
    assert lit(film("film.mp4")[0], 40) == {}


@pytest.mark.parametrize(
    "view", ["polarity", "time-surface", "time-surface:5ms", "accumulated", "accumulated:1", "voxel", "voxel:2"]
)
@pytest.mark.parametrize("size", [(1, 1), (3, 200), (700, 11), (1281, 721)])
def test_any_view_of_any_size_fits(view: str, size: tuple[int, int]) -> None:
    corner = events_of([0, 10_000, 20_000], size[0] - 1, size[1] - 1, [1, 0, 1])
    made = render(write(corner, size=size), "-o", "film.mp4", "--view", view, "--size", "301")
    shown = film("film.mp4")
    width, height = made["size"]
    assert width <= 301 and height <= 301 + canvas.LINE
    assert shown[0].shape == (height, width, 3)


def test_pixels_of_large_sensors_share_and_none_is_lost() -> None:
    k = np.arange(4000)
    write(events_of(k, k % 200, k // 200 * 3, 1), size=(200, 60))
    render("events.h5", "-o", "a.png", "--size", "100", "--view", "polarity", "--by", "count:4000", "--no-stamp")
    shown = picture("a.png")
    assert shown.shape == (30, 100, 3)
    assert (np.abs(shown - DARK).max(axis=2) > 60).sum() == 100 * 20


def test_the_line_says_when_and_how_many() -> None:
    write(events_of([0, 1000], [1, 2], 3, 1))
    plain, stamped = (
        render("events.h5", "-o", f"{name}.png", *more) for name, more in (("a", ["--no-stamp"]), ("b", []))
    )
    a, b = picture("a.png"), picture("b.png")
    assert stamped["size"] == [plain["size"][0], plain["size"][1] + canvas.LINE]
    np.testing.assert_array_equal(a, b[: len(a)])
    line = b[len(a) :]
    assert line[:, :100].max() > 120 and line[:, -100:].max() > 120 and np.abs(line[:, 400:800] - DARK).max() == 0


@pytest.mark.parametrize("width", [1, 20, 40, 60, 61, 62, 63, 64, 65, 90])
def test_the_line_of_a_narrow_picture_has_no_number_of_which_a_part_is_cut_off(width: int) -> None:
    times = events_of([0, 123_000], 0, 0, 1)
    lines = []
    for name, across in (("narrow", width), ("wide", 200)):
        write(times, f"{name}.h5", size=(across, 600))
        render(f"{name}.h5", "-o", f"{name}.png", "--size", "600", "--by", "count:2")
        lines.append(picture(f"{name}.png")[-canvas.LINE :])
    narrow, wide = lines
    said = wide[:, :100]
    last = np.flatnonzero(np.abs(said - DARK).max(axis=(0, 2)))[-1]
    if last < width - 1:
        np.testing.assert_array_equal(narrow[:, : last + 1], said[:, : last + 1])
    else:
        assert np.abs(narrow - DARK).max() == 0


# ------------------------------------------------------------------------------------------------------- with frames


class Filmed:
    """An event file with frames: frame k, at 50 ms k, is gray or coloured at level 40 k."""

    warnings: tuple[str, ...] = ("a cable was loose",)
    says_start, labelled, has_frames = True, False, True

    def __init__(self, size: tuple[int, int], colour: bool = False):
        self.path, self.size, self.start_us, self.colour = Path("davis.aedat4"), size, 0, colour

    def describe(self) -> dict[str, Any]:
        return {}

    def events(self, start_us: int | None = None, stop_us: int | None = None, block: int = BLOCK) -> Iterator[Events]:
        return within(iter([events_of(np.arange(0, 250_001, 1000), 2, 3, 1)]), start_us, stop_us)

    def frames(self) -> Iterator[Picture]:
        for k in range(1, 6):
            gray = np.full((12, 16), 40 * k, np.uint8)
            yield Picture(50_000 * k, np.stack([gray, gray // 2, gray * 0], axis=2) if self.colour else gray)


@pytest.fixture
def filmed(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Filmed:
    file = Filmed(*request.param)
    monkeypatch.setattr(rendering, "open_events", lambda path: file)
    return file


@pytest.mark.parametrize("filmed", [((32, 24), False), ((32, 24), True)], indirect=True)
def test_frames_are_beside_the_events_from_when_they_are_there(filmed: Filmed) -> None:
    made = render("davis.aedat4", "-o", "pictures", "--by", "duration:25ms", "--no-stamp")
    assert made["size"] == [1280, 480] and made["warnings"] == ["a cable was loose"]
    for k in range(10):
        shown = picture(f"pictures/{k:06d}.png")
        newest = 25_000 * (k + 1) // 50_000
        level = np.array([40, 20, 0] if filmed.colour else [40, 40, 40]) * newest
        np.testing.assert_array_equal(shown[240, 700:1200], np.broadcast_to(level if newest else DARK, (500, 3)))
        assert lit(shown[:, :640], 20) == {(2, 3): 1}


@pytest.mark.parametrize("filmed", [((32, 24), False)], indirect=True)
def test_a_window_begins_with_the_frame_that_was_there_and_ends_before_later_ones(filmed: Filmed) -> None:
    made = render("davis.aedat4", "-o", "a", "--start", "0.11", "--stop", "0.16", "--by", "duration:10ms", "--no-stamp")
    assert (made["slices"], made["start_us"], made["duration_us"]) == (5, 110_000, 50_000)
    assert [picture(f"a/{k:06d}.png")[240, 900].tolist() for k in (0, 2, 4)] == [[80] * 3, [80] * 3, [120] * 3]
    made = render("davis.aedat4", "-o", "b", "--start", "0.11", "--stop", "0.14", "--by", "duration:10ms", "--no-stamp")
    assert made["slices"] == 3 and picture("b/000002.png")[240, 900].tolist() == [80] * 3


@pytest.mark.parametrize("filmed", [((64, 24), False)], indirect=True)
def test_frames_are_under_wide_events(filmed: Filmed) -> None:
    made = render("davis.aedat4", "-o", "a.png", "--by", "source", "--view", "accumulated", "--no-stamp")
    assert made["size"] == [1280, 960] and made["slices"] == 5
    assert picture("a.png")[700, 640].tolist() == [40, 40, 40]
    assert (picture("a.png")[700, 100] == DARK).all()  # a frame that is narrower stands in the middle
    assert render("davis.aedat4", "-o", "b.png", "--no-frames", "--no-stamp")["size"] == [1280, 480]
    # (frames that are not shown have their times all the same)
    assert render("davis.aedat4", "-o", "c.png", "--by", "source", "--no-frames")["slices"] == 5


@pytest.mark.parametrize("kind", ["csv", "evt3", "dat", "npz", "v2e-hdf5"])
def test_a_recording_tells_its_frames_whatever_format_its_events_have(kind: str) -> None:
    """As from events.h5, which has their instants inside; others have them beside."""
    clip = np.linspace(0.1, 0.9, 6)[:, None, None] * np.linspace(0.5, 1, 32 * 24).reshape(24, 32)
    np.savez("clip.npz", frames=clip.astype(np.float32), t_us=np.cumsum([0, 10_000, 30_000, 20_000, 5_000, 15_000]))
    asked = ["--by", "source", "--size", "64", "--no-stamp"]
    for name in ("hdf5", kind):
        convert("clip.npz", name, formats=[name], preview=False)
        render(name, "-o", f"{name}-pictures", *asked)
        render(name, "-o", f"{name}-part", *asked, "--start", "0.02", "--stop", "0.07")
    for part in ("pictures", "part"):
        expected = {path.name: path.read_bytes() for path in Path(f"hdf5-{part}").iterdir()}
        assert (
            len(expected) > 3
            and {path.name: path.read_bytes() for path in Path(f"{kind}-{part}").iterdir()} == expected
        )


def test_frames_of_one_microsecond_are_one_picture() -> None:
    clip = "synthetic:moving-edge,size=32x24,fps=2e6,duration_s=2e-5,speed=2e5"
    for name in ("hdf5", "npz"):
        convert(clip, name, sensor="ideal", formats=[name], preview=False, upsample="none")
        render(name, "-o", f"{name}-pictures", "--by", "source", "--no-stamp")
    one, other = (
        {path.name: path.read_bytes() for path in Path(f"{name}-pictures").iterdir()} for name in ("hdf5", "npz")
    )
    assert one == other and len(one) > 9


def test_an_index_of_frames_that_is_none_is_refused() -> None:
    write(scattered())
    file = reformat("events.h5", "events.csv")
    assert file["events"] > 0
    Path("events.h5").unlink()
    for text in (
        "t_us,events\n5,0\n5,1\n",
        "t_us,events\n5,0\n4,0\n",
        "t_us,events\n5,1\n6,0\n",
        "t_us,events\n5\n6\n",
        "t_us,events\n5,1,2\n6,1,2\n",
        "t,n\n0,0\n",
        "t_us,events\none,0\n",
        "",
        "t_us,events\n99999999999999999999,0\n",
    ):
        Path("frame_index.csv").write_text(text)
        refused(DataError, "frame_index.csv", "events.csv", "-o", "a.png", "--by", "source")
    Path("events.csv").rename("other.csv")  # (the index speaks for files of a recording)
    refused(UsageError, "times of the frames", "other.csv", "-o", "a.png", "--by", "source")


# ------------------------------------------------------------------------------------------------------ what does not


def test_what_is_there_is_kept_unless_told_otherwise() -> None:
    write(scattered())
    for output in ("film.mp4", "a.png", "pictures"):
        render("events.h5", "-o", output, "--size", "64")
        refused(UsageError, "--overwrite replaces it", "events.h5", "-o", output)
        render("events.h5", "-o", output, "--overwrite", "--stop", "0.3")
    assert len(list(Path("pictures").iterdir())) == 1 + 9
    Path("pictures/notes.txt").touch()
    refused(UsageError, "notes.txt", "events.h5", "-o", "pictures", "--overwrite")
    Path("empty").mkdir()
    render("events.h5", "-o", "empty", "--stop", "0.1")


@pytest.mark.parametrize(
    ("sentence", "arguments"),
    [
        ("expected one of polarity", ["--view", "colours"]),
        ("view 'voxel:0': expected 1 to 1000 bins, such as voxel:5", ["--view", "voxel:0"]),
        ("view 'accumulated:x': expected events for full white, such as accumulated:2", ["--view", "accumulated:x"]),
        ("view 'polarity:3': expected one of polarity, accumulated:2, voxel:5", ["--view", "polarity:3"]),
        ("duration:10ms", ["--by", "often"]),
        ("times of the frames", ["--by", "source"]),
        ("leave out one", ["--by", "count:5", "--speed", "2"]),
        ("less than 1 us", ["--speed", "1e-6"]),
        ("no frames", ["--with-frames"]),
        ("not after --start", ["--start", "0.5", "--stop", "0.5"]),
        ("no events from 5 s to the end", ["--start", "5"]),
        ("no events from 0.5 s to 0.500001 s", ["--start", "0.5", "--stop", "0.500001"]),
        ("cannot be made", ["-o", "film.gif"]),
        ("within", ["-o", "."]),
        ("within", ["-o", ".."]),
        ("is a file", ["-o", "file"]),
    ],
)
def test_requests_that_cannot_be_meant(sentence: str, arguments: list[str]) -> None:
    write(scattered(50))
    Path("file").touch()
    refused(UsageError, sentence, "events.h5", *arguments)


@pytest.mark.parametrize(
    "arguments",
    [["--fps", "0"], ["--fps", "1001"], ["--fps", "fast"], ["--speed", "-1"], ["--size", "1"], ["--size", "9000"],
     ["--start=-1"], ["--stop", "inf"], ["--colour", "red"], [], ["--fps", "nan"], ["--speed", "nan"],
     ["--start", "nan"], ["--stop", "nan"]],
    ids=" ".join,
)  # fmt: skip
def test_options_that_cannot_be_meant(arguments: list[str]) -> None:
    write(scattered(50))
    result = CliRunner().invoke(command, [*(["events.h5"] if arguments else []), *arguments])
    assert result.exit_code == 2 and "Error: " in result.stderr and not Path("events.mp4").exists()


def test_files_that_are_none_or_damaged() -> None:
    refused(UsageError, "no such file", "missing.h5")
    Path("text.h5").write_text("t x y p")
    refused(DataError, "no event file", "text.h5")
    content = Path(write(scattered(600))).read_bytes()
    Path("cut.h5").write_bytes(content[: len(content) // 2])
    refused(DataError, "cut.h5", "cut.h5")


def test_events_outside_of_the_sensor_are_left_out_and_counted() -> None:
    with h5py.File(write(scattered(50)), "r+") as file:
        outside = int(((file["events/x"][()] >= 4) | (file["events/y"][()] >= 4)).sum())
        file.attrs["width"] = file.attrs["height"] = 4
    assert outside > 40
    said = [f"{outside} events outside of the 4x4 sensor are left out"]
    assert render("events.h5", "-o", "film.mp4")["warnings"] == said


def test_a_place_that_cannot_be_written_is_said_in_a_sentence() -> None:
    write(scattered(50))
    Path("file").touch()
    for output in ("file/film.mp4", "file/a.png", "file/pictures"):
        refused(DataError, "cannot be written", "events.h5", "-o", output)
