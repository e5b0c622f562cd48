"""preview.mp4: no event is lost, frames come when they should, browsers play it, and pieces make one film."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.pictures.colours import MOST
from vid2ev.recording.panels import COLOURS, GRAYS, NEUTRAL
from vid2ev.recording.preview import RATE, Preview, rate_for
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame

SIZE = (64, 48)


def frame_at(t_ns: int, level: float = 0.5, size: tuple[int, int] = SIZE, original: bool = True) -> Frame:
    return Frame(np.full(size[::-1], level, np.float32), t_ns, original)


def events_at(t_us: Sequence[int], x: int = 5, y: int = 6, p: int = 1) -> Events:
    n = len(t_us)
    return Events(np.array(t_us, np.int64), np.full(n, x, np.uint16), np.full(n, y, np.uint16), np.full(n, p, np.uint8))


def film(path: Path, steps: list[tuple[Frame, Events]], size: tuple[int, int] = SIZE, cuts: Sequence[int] = ()) -> Path:
    """A preview of (frame, events up to it); at each cut a new Preview goes on from the state of the old."""
    preview = Preview(size, path.parent)
    preview.begin(steps[0][0])
    for k, (frame, events) in enumerate(steps[1:], 1):
        preview.add(frame, events)
        if k in cuts:
            preview.close()
            state = preview.state()
            preview = Preview(size, path.parent)
            preview.restore(state)
            preview.begin(frame)
    preview.finish(Events.empty())
    preview.close()
    preview.join(path, (steps[-1][0].t_ns - steps[0][0].t_ns) // 1000)
    return path


def decoded(path: Path) -> dict[Fraction, np.ndarray]:
    """Luma of each frame by its time in units of the frame duration."""
    with av.open(str(path)) as container:
        pictures = container.decode(video=0)
        return {Fraction(p.pts) * p.time_base * RATE: p.to_ndarray()[: p.height].astype(int) for p in pictures}


def at_rate(fps: Fraction, n: int, quantum_ns: int = 1) -> list[int]:
    return [round(Fraction(k) / fps * 10**9 / quantum_ns) * quantum_ns for k in range(n)]


def test_a_browser_plays_it(tmp_path: Path) -> None:
    times = at_rate(Fraction(25), 40)
    path = film(tmp_path / "preview.mp4", [(frame_at(t), events_at([t // 1000])) for t in times], cuts=[7, 20])
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")  # playing begins before all is loaded
    with av.open(str(path)) as container:
        (stream,) = container.streams
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.codec_context.color_range, stream.codec_context.colorspace) == (1, 1)
        assert stream.width % 2 == 0 and stream.height % 2 == 0
        packets = [packet for packet in container.demux(stream) if packet.size]
    assert [packet.dts for packet in packets] == [packet.pts for packet in packets]
    assert len(packets) == math.ceil((times[-1] / 1e9) * RATE - 0.25) + 1


@pytest.mark.parametrize(
    ("fps", "quantum_ns"),
    [(Fraction(30), 1), (Fraction(30), 10**6), (Fraction(30000, 1001), 1), (Fraction(30000, 1001), 10**6)],
)
def test_frames_at_its_own_rate_are_shown_one_by_one(tmp_path: Path, fps: Fraction, quantum_ns: int) -> None:
    levels = np.linspace(0.05, 0.95, 90)
    steps = [
        (frame_at(t, level), Events.empty()) for t, level in zip(at_rate(fps, 90, quantum_ns), levels, strict=True)
    ]
    shown = decoded(film(tmp_path / "preview.mp4", steps))
    assert sorted(shown) == list(range(90))
    for number, picture in shown.items():
        assert abs(picture[20, 20] - GRAYS[round(levels[int(number)] * 65535)]) <= 3, number


def test_every_event_is_shown_once_in_its_window(tmp_path: Path) -> None:
    # One event each, at its own pixel: the bright pixels of frame k are those with t in (t_(k-1), t_k].
    random = np.random.default_rng(0)
    pixels = random.permutation(SIZE[0] * SIZE[1])[:200]
    t_us = np.sort(random.integers(1, 2_000_000, 200))
    instants = [10**6 * (4 * k + 1) // (4 * RATE) for k in range(61)]
    t_us[:5] = np.sort(instants[:5])  # on the border: still in
    t_us = np.sort(t_us)
    x, y = (pixels % SIZE[0]).astype(np.uint16), (pixels // SIZE[0]).astype(np.uint16)
    events = Events(t_us, x, y, np.ones(200, np.uint8))
    edges = np.searchsorted(t_us, np.arange(0, 2_000_001, 10_000), side="right")
    steps = [
        (frame_at(10**7 * k, original=k % 3 == 0), events.select(np.arange(edges[max(k - 1, 0)], edges[k])))
        for k in range(201)
    ]
    shown = decoded(film(tmp_path / "preview.mp4", steps, cuts=[30, 60, 120]))
    assert max(shown) == 60
    enlarged = 640 // max(SIZE)
    found = {}
    for number, picture in shown.items():
        right = picture[enlarged // 2 :: enlarged, SIZE[0] * enlarged + enlarged // 2 :: enlarged]
        for down, across in np.argwhere(right > (int(COLOURS[0, 0, 0]) + int(COLOURS[0, 1, 0])) / 2):
            found.setdefault((int(across), int(down)), []).append(int(number))
    expected = {(int(a), int(b)): [int(np.searchsorted(instants, t))] for a, b, t in zip(x, y, t_us, strict=True)}
    assert found == expected


def test_more_events_than_can_be_told_apart_are_as_bright_as_the_most(tmp_path: Path) -> None:
    events = Events.concatenate(
        [events_at([1000] * MOST, 5), events_at([1000] * 700, 6), events_at([1000] * 700, 7, p=0)]
    )
    steps = [(frame_at(0), Events.empty()), (frame_at(10**8), events)]
    shown = decoded(film(tmp_path / "preview.mp4", steps))
    picture = shown[Fraction(0)][6 * 10 + 5, 640 + 5 :: 10]
    assert abs(picture[5] - int(COLOURS[0, MOST, 0])) <= 6 and abs(picture[6] - picture[5]) <= 6
    assert abs(picture[7] - int(COLOURS[MOST, 0, 0])) <= 6


def test_a_long_silence_costs_nothing(tmp_path: Path) -> None:
    steps = [
        (frame_at(0), Events.empty()),
        (frame_at(3600 * 10**9, 0.9), events_at([1_800_000_000])),
        (frame_at(3600 * 10**9 + 10**8), Events.empty()),
    ]
    shown = decoded(film(tmp_path / "preview.mp4", steps))
    assert len(shown) < 10
    lit = [number for number, picture in shown.items() if picture[6 * 10 + 5, 640 + 5 * 10 + 5] > 60]
    assert lit == [1800 * RATE]


def test_events_sent_late_are_shown_late(tmp_path: Path) -> None:
    steps = [
        (frame_at(0), Events.empty()),
        (frame_at(10**8), Events.empty()),
        (frame_at(2 * 10**8), events_at([50_000])),
    ]
    shown = decoded(film(tmp_path / "preview.mp4", steps))
    assert [number for number, picture in shown.items() if picture[6 * 10 + 5, 640 + 5 * 10 + 5] > 60] == [3]


def test_polarities_have_their_colours(tmp_path: Path) -> None:
    blocks = [(x, y) for x in range(8, 16) for y in range(8, 16)]
    on = [events_at([1000], x, y, 1) for x, y in blocks]
    off = [events_at([1000], x + 20, y, 0) for x, y in blocks]
    steps = [(frame_at(0, 1.0), Events.empty()), (frame_at(10**6, 1.0), Events.concatenate([*on, *off]))]
    with av.open(str(film(tmp_path / "preview.mp4", steps))) as container:
        *_, last = container.decode(video=0)
        rgb = last.to_ndarray(format="rgb24").astype(int)
    amber, blue, white = rgb[120, 640 + 120], rgb[120, 640 + 320], rgb[300, 300]
    assert amber[0] > amber[1] > amber[2] + 30 and blue[2] > blue[1] > blue[0]
    assert (white > 245).all()


@pytest.mark.parametrize("size", [(1, 1), (3, 1), (1, 999), (641, 5), (346, 260), (1281, 721), (720, 1280)])
def test_any_size_fits(tmp_path: Path, size: tuple[int, int]) -> None:
    corner = events_at([500], size[0] - 1, size[1] - 1)
    steps = [(frame_at(0, size=size), Events.empty()), (frame_at(10**6, size=size), corner)]
    (*_, picture) = decoded(film(tmp_path / "preview.mp4", steps, size)).values()
    assert picture.shape[0] <= 640 and picture.shape[1] <= 1280
    assert picture.shape[0] % 2 == 0 and picture.shape[1] % 4 == 0
    assert picture[-1, -1] > COLOURS[0, 0, 0] + 30


@pytest.mark.parametrize("size", [(1280, 720), (720, 1280), (1000, 700)])
def test_an_event_is_where_it_was_in_a_frame_made_smaller(tmp_path: Path, size: tuple[int, int]) -> None:
    x, y = size[0] // 2 + 60, size[1] // 3
    steps = [(frame_at(0, size=size), Events.empty()), (frame_at(10**6, size=size), events_at([500] * 9, x, y))]
    (*_, picture) = decoded(film(tmp_path / "preview.mp4", steps, size)).values()
    right, shrunk = picture[:, picture.shape[1] // 2 :], 640 / max(size)
    down, across = np.unravel_index(np.argmax(right), right.shape)
    assert abs(across - x * shrunk) <= 1 and abs(down - y * shrunk) <= 1


def test_light_beyond_the_display_is_white_or_black(tmp_path: Path) -> None:
    light = np.full(SIZE[::-1], 1e9, np.float32)
    light[:, :16], light[:, 16:32], light[:, 32:48] = -5, np.nan, np.inf
    steps = [(Frame(light, 0), Events.empty()), (Frame(light, 10**6), Events.empty())]
    (*_, picture) = decoded(film(tmp_path / "preview.mp4", steps)).values()
    np.testing.assert_allclose(picture[100, [80, 240, 400, 560]], [16, 16, 235, 235], atol=2)


def test_the_pieces_do_not_show(tmp_path: Path) -> None:
    steps = [(frame_at(k * 10**7, 0.3 + 0.01 * (k % 20)), events_at([k * 10_000 - 3], k % 60, 20)) for k in range(100)]
    one = decoded(film(tmp_path / "one.mp4", steps))
    other = decoded(film(tmp_path / "other.mp4", steps, cuts=[1, 2, 3, 50, 98, 99]))
    assert list(one) == list(other)
    for number in one:
        assert np.abs(one[number] - other[number]).mean() < 1


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("by", [-(10**15), 10**10, 1 << 60])
def test_a_state_of_another_time_is_refused(which: int, by: int, tmp_path: Path) -> None:
    """One long ago would have a film of all the time since then; one far off has frames that no film can hold."""
    preview = Preview(SIZE, tmp_path)
    preview.begin(frame_at(0))
    preview.add(frame_at(10**9), events_at([5]))
    preview.close()
    state = preview.state()
    state["clock"][which] += by
    with pytest.raises(UsageError, match="state of a preview"):
        preview.restore(state)
        preview.begin(frame_at(10**9))


@pytest.mark.parametrize("name", ["clock", "starts", "counts", "piece"])
def test_a_refused_state_changes_nothing(name: str, tmp_path: Path) -> None:
    for folder in ("old", "new"):
        (tmp_path / folder).mkdir()
    old, new = (Preview(SIZE, tmp_path / folder) for folder in ("old", "new"))
    for preview in (old, new):
        preview.begin(frame_at(0))
    old.add(frame_at(10**9), events_at([5]))
    old.close()
    before, state = new.state(), old.state()
    wrong = state if name == "piece" else state | {name: state[name].astype(np.complex64)}  # (it has no pieces yet)
    with pytest.raises(UsageError, match=f"'{name}'" if name != "piece" else "without its piece 0"):
        new.restore(wrong)
    after = new.state()
    assert all(np.array_equal(after[each], before[each]) for each in before)


def test_a_state_of_more_frames_than_there_was_time_for_is_refused(tmp_path: Path) -> None:
    preview = Preview(SIZE, tmp_path)
    preview.begin(frame_at(0))
    preview.add(frame_at(10**9), events_at([5]))
    preview.close()
    state = preview.state()
    state["clock"][1] += 100
    preview.restore(state)
    with pytest.raises(UsageError, match="130 frames for 1 s"):
        preview.join(tmp_path / "preview.mp4", 10**6)


def test_an_unwanted_preview_makes_no_file(tmp_path: Path) -> None:
    preview = Preview(SIZE, tmp_path, wanted=False)
    preview.begin(frame_at(0))
    preview.add(frame_at(10**9), events_at([5]))
    preview.finish(events_at([6]))
    preview.close()
    preview.join(tmp_path / "preview.mp4", 10**6)
    assert list(tmp_path.iterdir()) == []


def test_the_colours_are_calm_and_grow() -> None:
    assert (np.diff(COLOURS[0, :, 0].astype(int)) >= 0).all() and (np.diff(COLOURS[:, 0, 0].astype(int)) >= 0).all()
    assert COLOURS[..., 0].min() >= 16 and COLOURS[..., 0].max() <= 235
    assert abs(int(COLOURS[0, 0, 1]) - NEUTRAL) < 8 and abs(int(COLOURS[0, 0, 2]) - NEUTRAL) < 8


@pytest.mark.parametrize(
    ("frames", "duration_s", "rate"),
    [(300, 10.0, 30), (40, 10.0, 30), (10, 10.0, 8), (108, 10_800.0, 1), (None, 3.0, 30), (1, 0.0, 30), (2, None, 30)],
)
def test_slow_sources_have_fewer_frames(frames: int | None, duration_s: float | None, rate: int) -> None:
    assert rate_for(frames, duration_s) == rate
