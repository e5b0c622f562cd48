"""Frames and events from files of their own, from one file that has both, and a single frame with its events."""

from __future__ import annotations

import json
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import pytest
import torch
from scipy.io import savemat
from small_takes import SIZE, STEP_US, images, moving, recording, strange

from interp.data.layouts import open_sequence
from interp.interpolate.after import After
from interp.interpolate.event_cursor import EventCursor
from interp.interpolate.fill import FEWEST, MOST, NO_EVENTS, steps_for
from interp.interpolate.instants import Grid, Rate, Times
from interp.interpolate.of_sequence import OfSequence
from interp.interpolate.take import Options, open_take
from interp.interpolate.whole import frames, interpolate
from interp.light import luminance, to_codes, to_light
from interp.methods.gap import Gap
from interp.methods.of_networks import OfEvents
from interp.methods.one_frame import OneFrame
from interp.networks import make
from interp.networks.hdr import Hdr
from interp.representation.dead_time import DeadTime
from interp.representation.event_counts import EventCounts
from interp.weights import save
from vid2ev import DvsSpec, Events, convert, read_events
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import format_named
from vid2ev.formats.event_file import Picture, Recording
from vid2ev.recording.exposures import read_codes, write_codes
from vid2ev.recording.truth_files import read_pixel_map, write_pixel_map
from vid2ev.rig.intrinsics import Intrinsics


def drawn(count: int = 3000, us: int = 3 * STEP_US) -> Events:
    draw = np.random.default_rng(0)
    t = np.sort(draw.integers(0, us + 1, count)).astype(np.int64)
    x, y = (draw.integers(0, side, count).astype(np.uint16) for side in SIZE)
    return Events(t, x, y, draw.integers(0, 2, count).astype(np.uint8))


def written(path: Path, events: Events, format: str = "npz", frames: Any = None) -> Path:
    kind = format_named(format)
    assert kind.write is not None
    blocks = [events.stretch(k, min(k + 100, len(events))) for k in range(0, len(events), 100)]
    kind.write(path, Recording(SIZE, 0, int(events.t[-1]), len(events), lambda: iter(blocks), frames=frames))
    return path


def same(one: Events, other: Events) -> None:
    for name in "txyp":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("format", ["npz", "hdf5", "csv"])
def test_a_cursor_gives_each_event_once_and_goes_back_if_it_has_to(tmp_path: Path, format: str) -> None:
    events = drawn()
    cursor = EventCursor(written(tmp_path / f"a{format_named(format).suffix}", events, format))
    edges = [-1, 10, 10, 5000, 5001, 60_000, 10**6]
    parts = [cursor.between(*edges[k : k + 2]) for k in range(len(edges) - 1)]
    same(Events.concatenate(parts), events)
    for start, stop in ((70_000, 80_000), (20, 30_000), (30_000, 30_001), (0, 10**6)):
        same(cursor.between(start, stop), events.select((events.t > start) & (events.t <= stop)))


def test_a_cursor_that_looks_back_begins_each_stretch_before(tmp_path: Path) -> None:
    events, back_us = drawn(), 7_000
    cursor = EventCursor(written(tmp_path / "a.npz", events), back_us)
    forwards = [*pairwise([-1, 10, 10, 5000, 5001, 60_000, 10**6])]
    for start, stop in (*forwards, (60_000, 70_000), (20_000, 30_000)):
        same(cursor.between(start, stop), events.select((events.t > start - back_us) & (events.t <= stop)))


def test_events_before_a_gap_are_given_where_a_dead_time_is_known(tmp_path: Path) -> None:
    """Whether they are in files of their own, or in those of a recording."""
    frames, events = images(tmp_path / "frames", moving()), drawn()
    own = recording(tmp_path / "own", moving(4))
    for source, path in ((frames, written(tmp_path / "events.npz", events)), (own, None)):
        plain, told = (open_take(str(source), Options(events=path, refractory_us=each)) for each in (None, 500))
        for start_us, stop_us in pairwise([0, STEP_US, 2 * STEP_US]):
            gap, more = (take.events(start_us, stop_us) for take in (plain, told))
            assert gap is not None and more is not None
            same(more.select(more.t > start_us), gap)
            assert more.t[0] < start_us or not start_us
            assert more.t[0] > start_us - 16 * 500


@pytest.mark.parametrize("kind", ["beside", "folder", "with frames", "still"])
def test_what_events_of_a_recording_stand_for_it_says_wherever_they_lie(tmp_path: Path, kind: str) -> None:
    numbers = DvsSpec(threshold_on=0.3, threshold_off=0.2, refractory_us=700).model_dump(mode="json")
    manifest = json.dumps({"versions": {"vid2ev": "0"}, "sensor": {"parameters": numbers}})
    made = moving(3)
    pictures = [Picture(STEP_US * k, np.repeat(frame[..., :1], 3, axis=2)) for k, frame in enumerate(made)]
    names = {"with frames": ("aedat4", "events.aedat4")}
    format, name = names.get(kind, ("npz", "events.npz"))
    path = written(tmp_path / name, drawn(us=2 * STEP_US), format, frames=lambda: iter(pictures))
    source = images(tmp_path / "in", made[:1] if kind == "still" else made)
    source = path if kind == "with frames" else source / "000000.png" if kind == "still" else source
    events = None if kind == "with frames" else tmp_path if kind == "folder" else path
    plain = open_take(source, Options(events=events))
    (tmp_path / "manifest.json").write_text(manifest)
    said, asked = (open_take(source, Options(events=events, contrast=of)) for of in (None, (0.4, 0.5)))
    assert plain.contrast == ((0.15, 0.15) if kind == "still" else None) and plain.dead_time is None
    assert said.contrast == (0.2, 0.3) and said.dead_time == DeadTime(700, numbers["refractory"])
    assert asked.contrast == (0.4, 0.5) and asked.dead_time == said.dead_time
    path.rename(path.with_stem("other"))  # (of which the manifest does not speak)
    if kind != "folder":
        other = path.with_stem("other")
        source, events = (other, None) if kind == "with frames" else (source, other)
        assert open_take(source, Options(events=events)).contrast == plain.contrast


def test_a_sensor_of_unknown_size_is_that_of_the_frames_if_all_events_are_within(tmp_path: Path) -> None:
    """As of a file that states it; and it is said."""
    frames = images(tmp_path / "frames", moving())
    inside = drawn()
    inside = inside.select((inside.x < 30) & (inside.y < 20))
    made = {}
    for format in ("csv", "npz"):
        path = written(tmp_path / f"events{format_named(format).suffix}", inside, format)
        take = open_take(str(frames), Options(events=path))
        made[format] = take.event_size, take.apart, [text for text in take.remarks if "does not state" in text]
    assert made["npz"] == (SIZE, False, [])
    assert made["csv"][:2] == (SIZE, False) and made["csv"][2][0].endswith("taken for 64x48")
    (tmp_path / "larger.csv").write_text("t,x,y,p\n0,99,10,1\n20000,0,0,0\n")
    take = open_take(str(frames), Options(events=tmp_path / "larger.csv"))
    assert take.event_size == (100, 11) and any("taken for 100x11" in text for text in take.remarks)


@pytest.mark.parametrize("size", [None, "20", "20x16!"])
@pytest.mark.parametrize("crop", [None, "40x32+12+5"])
def test_coarse_events_that_are_laid_over_a_part_of_the_frames_are_said_to_be(
    tmp_path: Path, crop: str | None, size: str | None
) -> None:
    """Of a film of that part, as it is, nothing is said."""
    events, whole = drawn(), images(tmp_path / "whole", moving(3))
    part = images(tmp_path / "part", [frame[5:37, 12:52] if crop else frame for frame in moving(3)])
    path = tmp_path / "coarse.npz"
    np.savez(path, t=events.t, x=events.x // 4, y=events.y // 4, p=events.p, size=(16, 12))
    one = open_take(whole, Options(events=path, crop=crop, size=size))
    other = open_take(part, Options(events=path, size=size))
    assert [any("laid over" in text for text in take.remarks) for take in (one, other)] == [bool(crop), False]
    assert one.event_size == other.event_size == (16, 12) and one.apart


@pytest.mark.parametrize("says_its_size", [True, False])
def test_events_of_whole_frames_are_cropped_as_these_are(tmp_path: Path, says_its_size: bool) -> None:
    """What frames and events are that somebody else has cropped."""
    shown, events = moving(3), drawn()
    left, top, width, height = 12, 5, 40, 32
    inside = (events.x >= left) & (events.x < left + width) & (events.y >= top) & (events.y < top + height)
    part = events.select(inside)
    part = Events(part.t, part.x - np.uint16(left), part.y - np.uint16(top), part.p)
    cut = [frame[top : top + height, left : left + width] for frame in shown]
    made = []
    for name, pictures, sent, size, crop in (
        ("whole", shown, events, SIZE, f"{width}x{height}+{left}+{top}"), ("part", cut, part, (width, height), None)
    ):  # fmt: skip
        path = tmp_path / f"{name}.npz"
        columns = {"t": sent.t, "x": sent.x, "y": sent.y, "p": sent.p}
        np.savez(path, **columns, **({"size": size} if says_its_size else {}))
        options = Options(events=path, crop=crop, contrast=(0.2, 0.2))
        take = open_take(images(tmp_path / name, pictures), options)
        assert take.event_size == (width, height) and not take.apart
        assert any("cropped" in remark for remark in take.remarks) == bool(crop)
        made += [[frame.codes for frame in frames(tmp_path / name, multiple=2, method="bridge", options=options)]]
    np.testing.assert_allclose(*made, atol=1e-6)  # (codes of cropped frames have been light in between)


@pytest.mark.parametrize("later_us", [10**9, -(10**9)])
def test_events_by_another_clock_are_warned_of(tmp_path: Path, later_us: int) -> None:
    frames = images(tmp_path / "frames", moving(), start_us=max(0, -later_us))
    events = drawn()
    late = Events(events.t + max(0, later_us), events.x, events.y, events.p)
    (tmp_path / "late.csv").write_text(
        "t,x,y,p\n" + "".join(f"{t},{x},{y},{p}\n" for t, x, y, p in zip(late.t, late.x, late.y, late.p, strict=True))
    )
    take = open_take(str(frames), Options(events=tmp_path / "late.csv"))
    assert any("no event lies beside a frame" in text for text in take.remarks)


def test_a_cursor_holds_no_more_than_a_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cursor = EventCursor(written(tmp_path / "a.npz", drawn(20_000)))
    taken: list[int] = []

    def blocks() -> Any:
        for part in read_events(tmp_path / "a.npz", block=100):
            taken.append(len(part))
            yield part

    monkeypatch.setattr(cursor, "_recording", type("R", (), {"blocks": staticmethod(blocks)}))
    for k in range(10):
        cursor.between(1000 * k, 1000 * (k + 1))
    assert sum(taken) <= 100 * (20_000 * 10_000 // (3 * STEP_US) // 100 + 2)


@pytest.mark.parametrize("first_us", [0, 1000])
def test_what_lies_before_a_stretch_is_let_go_as_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first_us: int
) -> None:
    """Of a part that begins late, or after a cut, over which nobody asks for events."""
    path = written(tmp_path / "a.npz", drawn(20_000))
    cursor, late_us = EventCursor(path), 3 * STEP_US - 1000
    wanted, held = read_events(path, block=10**6), list[weakref.ref[np.ndarray]]()

    def blocks() -> Any:
        for part in read_events(path, block=100):
            times = part.t.copy()
            yield Events(times, part.x, part.y, part.p)
            held.append(weakref.ref(times))
            del times
            assert sum(each() is not None for each in held) <= 3

    monkeypatch.setattr(cursor, "_recording", type("R", (), {"blocks": staticmethod(blocks)}))
    cursor.between(0, first_us)
    found, all_of_them = cursor.between(late_us, 3 * STEP_US - 900), Events.concatenate(wanted)
    inside = (all_of_them.t > late_us) & (all_of_them.t <= 3 * STEP_US - 900)
    same(found, all_of_them.select(inside))


def test_events_in_a_file_of_their_own_are_those_of_a_recording(tmp_path: Path) -> None:
    source, events = images(tmp_path / "in", moving(4)), written(tmp_path / "a.npz", drawn())
    frames = [Picture(STEP_US * k, frame) for k, frame in enumerate(moving(4))]
    both = written(tmp_path / "both.aedat4", drawn(), "aedat4", lambda: iter(frames))
    options = Options(events=events, contrast=(0.2, 0.2))
    told = interpolate(source, tmp_path / "one", multiple=3, method="bridge", options=options)
    assert not told["gaps_s"]
    interpolate(both, tmp_path / "other", multiple=3, method="bridge", options=Options(contrast=(0.2, 0.2)))
    for k in range(10):
        one, other = (read_codes(tmp_path / name / f"{k:06d}.png") for name in ("one", "other"))
        np.testing.assert_array_equal(one, other)
        if k % 3 == 0:
            np.testing.assert_array_equal(one, moving(4)[k // 3])
    part = interpolate(both, tmp_path / "part", multiple=1, options=Options(start_s=0.03, stop_s=0.07))
    assert part["key_frames"] == 2 and part["start_us"] == STEP_US


@pytest.mark.parametrize("other", [lambda frame: frame[:40], lambda frame: frame[..., 0]])
def test_frames_of_an_event_file_that_change_their_size_are_taken_as_far_as_they_do_not(
    tmp_path: Path, other: Callable[[np.ndarray], np.ndarray]
) -> None:
    """As of a camera of which only a part is read out from then on, or in gray."""
    shown = [frame if k < 2 else other(frame).copy() for k, frame in enumerate(moving(4))]
    pictures = [Picture(STEP_US * k, frame) for k, frame in enumerate(shown)]
    path = written(tmp_path / "a.aedat4", drawn(), "aedat4", lambda: iter(pictures))
    with pytest.raises(DataError, match=r"64x48 coloured pixels up to 0.066666 s, and then of .* --stop or --start"):
        interpolate(path, tmp_path / "out", multiple=2, method="bridge")
    for part in ({"stop_s": 0.05}, {"start_s": 0.05}):
        for k, frame in enumerate(frames(path, multiple=1, method="bridge", options=Options(**part))):
            expected = shown[k + 2 * ("start_s" in part)]
            np.testing.assert_array_equal(np.rint(255 * frame.codes), expected.reshape(*expected.shape[:2], -1))


def test_events_of_a_camera_nobody_knows_are_those_of_the_pixels_of_its_frames(tmp_path: Path) -> None:
    """Also where none came from its last column or row."""
    some, pictures = drawn(), [Picture(STEP_US * k, frame) for k, frame in enumerate(moving(4))]
    inside = some.select((some.x < 50) & (some.y < 30))
    path = written(tmp_path / "a.aedat4", inside, "aedat4", lambda: iter(pictures))
    known = open_take(path)
    content = path.read_bytes()
    path.write_bytes(content.replace(b'"sizeX"', b'"sizeA"').replace(b'"sizeY"', b'"sizeB"'))
    assert path.read_bytes() != content
    take = open_take(path)
    assert known.event_size == take.event_size == take.size == SIZE


@pytest.mark.parametrize("grid", [{"multiple": "1/2"}, {"multiple": "2/3"}, {"multiple": 2}, {"fps": "7"}])
def test_what_remembers_sees_each_event_of_a_shot_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, grid: dict[str, Any]
) -> None:
    """Those of gaps in which nothing is made, too; after a cut it begins anew."""
    save(tmp_path / "some.safetensors", "firenet", make("firenet"))
    seen: list[tuple[int, bool]] = []
    images = OfEvents.images

    def counted(self: OfEvents, gap: Gap, *asked: Any) -> Iterator[torch.Tensor]:
        assert gap.events is not None
        seen.append((int(gap.events.off_on.sum()), bool(self.states)))
        return images(self, gap, *asked)

    monkeypatch.setattr(OfEvents, "images", counted)
    source = recording(tmp_path / "in", [*moving(4, seed=1), *moving(3, seed=2)])
    interpolate(source, tmp_path / "out", network=tmp_path / "some.safetensors", **grid)
    assert seen == [(400, False), (400, True), (400, True), (400, False), (400, True)]


@pytest.mark.parametrize("begin_us", [0, 1_000_000])
@pytest.mark.parametrize("stated", [False, True])
def test_a_file_that_states_no_beginning_knows_nothing_of_the_time_before_its_events(
    tmp_path: Path, stated: bool, begin_us: int
) -> None:
    """And one that does knows that there were none."""
    source = images(tmp_path / "in", moving(7), start_us=begin_us)
    some = drawn()
    events = Events(some.t + begin_us + 3 * STEP_US, some.x, some.y, some.p)
    late = Recording(SIZE, begin_us, int(events.t[-1]) - begin_us, len(events), lambda: iter([events]))
    write = format_named("npz").write
    assert write is not None
    write(tmp_path / "late.npz", late)
    if not stated:
        with np.load(tmp_path / "late.npz") as written:
            columns = {name: written[name] for name in "txyp"}
        np.savez(tmp_path / "late.npz", **columns)
    told = interpolate(
        source, tmp_path / "out", multiple=2, method="bridge", options=Options(events=tmp_path / "late.npz")
    )
    seconds = [(begin_us + STEP_US * k) / 1e6 for k in range(4)]
    unknown = [[seconds[k], seconds[k + 1]] for k in range(3)]
    assert told["gaps_s"] == ({} if stated else {"events that are not known": unknown})


@pytest.mark.parametrize("parts", [1, 2, 7, 32, 33, 100, 128, 129, 160, 250, 256, 997, 5000])
def test_frames_lie_at_the_ends_of_sub_intervals_or_of_as_many_as_can_be(parts: int) -> None:
    steps = steps_for(Fraction(parts))
    assert FEWEST <= steps <= MOST
    if parts <= MOST:
        assert steps % parts == 0
    else:
        assert parts % steps == 0 or (steps == MOST and not any(parts % k == 0 for k in range(FEWEST, MOST)))


@pytest.mark.parametrize(
    "grid", [Times(Fraction(5, 2)), Times(Fraction(2, 3)), *(Rate(Fraction(k)) for k in (75, 90, 100))]
)
def test_frames_lie_at_the_ends_of_sub_intervals_where_they_are_no_whole_number_to_a_key_frame_too(grid: Grid) -> None:
    """But for the microseconds that times of key frames are rounded to; where that takes very many they do not."""
    key_hz = Fraction(30)
    keys_us = [round(10**6 * k / key_hz) for k in range(8)]
    steps = steps_for(grid.multiple_of(key_hz))
    assert FEWEST <= steps <= MOST
    for k, (start_us, stop_us) in enumerate(pairwise(keys_us)):
        for instant in grid.between(k, start_us, stop_us, 0):
            off_us = abs(steps * instant.share - round(steps * instant.share)) / steps * (stop_us - start_us)
            assert off_us <= 2, (k, instant)
    assert steps_for(Rate(Fraction("10.0001")).multiple_of(Fraction(10))) == 2 * FEWEST


@pytest.mark.parametrize("related", [True, False])
@pytest.mark.parametrize("grid", [{"multiple": "1/2"}, {"multiple": "2/3"}, {"multiple": 2}, {"fps": "10.0001"}])
def test_hdr_is_told_at_key_frames_of_all_events_between_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, grid: dict[str, Any], related: bool
) -> None:
    """However few frames are made, and where they are held because pictures have nothing in common."""
    shown = moving(7) if related else list(np.random.default_rng(0).integers(0, 256, (7, *SIZE[::-1], 3), np.uint8))
    source, events = images(tmp_path / "in", shown), drawn(us=6 * STEP_US)
    path = written(tmp_path / "a.npz", events)
    told, begun, forward, processed = [], [], Hdr.forward, After.frames

    def noted(after: After, work: Any) -> Any:
        begun.append(len(told))  # (its first picture is the key frame's)
        yield from processed(after, work)

    monkeypatch.setattr(After, "frames", noted)

    def heard(network: Hdr, frame: torch.Tensor, second: torch.Tensor, state: Any, residue: Any) -> Any:
        told.append(second.double().sum((0, 1)))
        return forward(network, frame, second, state, residue=residue)

    monkeypatch.setattr(Hdr, "forward", heard)
    save(tmp_path / "hdr.safetensors", "hdr", make("hdr"))
    given = {"method": "flow", "hdr": tmp_path / "hdr.safetensors"}
    options = Options(events=path, contrast=(0.15, 0.3))
    for _ in frames(source, **given, **grid, options=options):
        pass
    wanted = np.zeros(SIZE[::-1])
    np.add.at(wanted, (events.y, events.x), np.where(events.p, 0.3, -0.15) / 0.45)
    assert len(begun) == 7
    np.testing.assert_allclose(torch.stack([told[k] for k in begun]).sum(0), wanted, atol=1e-5)


@pytest.mark.parametrize("second", ["events", "frames"])
def test_hdr_makes_the_same_of_key_frames_however_many_are_between(tmp_path: Path, second: str) -> None:
    network = make("hdr", second=second)
    torch.nn.init.normal_(network.out.weight, std=0.05)
    save(tmp_path / "hdr.safetensors", "hdr", network)
    source, events = images(tmp_path / "in", moving(5)), written(tmp_path / "a.npz", drawn(us=4 * STEP_US))
    made = {}
    for multiple in (1, 2, 5):
        options = Options(events=events, contrast=(0.15, 0.3))
        for frame in frames(
            source, multiple=multiple, method="bridge", hdr=tmp_path / "hdr.safetensors", options=options
        ):
            made[multiple, frame.instant.t_us] = frame.codes
    for multiple in (2, 5):
        for k in range(5):
            np.testing.assert_allclose(made[multiple, STEP_US * k], made[1, STEP_US * k], atol=1e-4)  # (other sums)
    assert not np.array_equal(made[2, STEP_US], made[2, 0])


@pytest.mark.parametrize("second", ["events", "frames"])
@pytest.mark.parametrize("between", ["a cut", "pictures that have nothing in common"])
def test_hdr_of_frames_that_are_held_is_that_of_their_key_frames(tmp_path: Path, between: str, second: str) -> None:
    network = make("hdr", second=second)
    torch.nn.init.normal_(network.out.weight, std=0.05)
    save(tmp_path / "hdr.safetensors", "hdr", network)
    shown = [*moving(4, seed=1), *moving(4, seed=2)] if between == "a cut" else strange()
    source = recording(tmp_path / "in", [np.clip(1.25 * frame - 20.0, 0, 255).astype(np.uint8) for frame in shown])
    given = {"method": "flow", "hdr": tmp_path / "hdr.safetensors", "options": Options(contrast=(0.15, 0.3))}
    told = interpolate(source, tmp_path / "out", multiple=4, **given)
    keys = [frame.codes for frame in frames(source, multiple=1, **given)]
    (held,) = told["gaps_s"].values()
    assert list(told["gaps_s"]) == [between] and len(held) == (1 if between == "a cut" else 3)
    for frame in frames(source, multiple=4, **given):
        if any(since <= frame.instant.t_us / 1e6 <= until for since, until in held):
            nearer = frame.instant.number // 4 + (frame.instant.number % 4 == 3)
            np.testing.assert_allclose(frame.codes, keys[nearer], atol=1e-5)


def test_a_recording_of_convert_is_interpolated_whatever_it_has_of_its_frames(tmp_path: Path) -> None:
    source = images(tmp_path / "in", moving(7))
    for kind in ("png", "raw"):
        convert(
            source, tmp_path / kind, frame_camera=True, cis="ideal", pictures=[kind], preview=False,
            overrides=["cis.frame_rate_hz=15"], threads=1,
        )  # fmt: skip
        told = interpolate(tmp_path / kind, tmp_path / f"{kind}_out", multiple=2)
        assert told["interpolation"]["method"] not in ("flow", "linear") and told["source"]["contrast"]
    for file in (tmp_path / "png_out").glob("*.png"):
        assert file.read_bytes() == (tmp_path / "raw_out" / file.name).read_bytes()
    frames = sorted((tmp_path / "png").rglob("frames/*.png"))
    for k, frame in enumerate(frames):
        found = read_codes(tmp_path / "png_out" / f"{2 * k:06d}.png")
        np.testing.assert_array_equal(found, read_codes(frame))


@pytest.mark.parametrize("other", ["size = [32, 24]", "translation_mm = [80, 0, 0]"])
def test_frames_to_rebuild_are_those_of_a_camera_that_sees_what_key_frames_show(tmp_path: Path, other: str) -> None:
    """And events are of the camera in its place, whatever else is in the rig."""
    rig = tmp_path / "rig.toml"
    cameras = [("a", "dvs", "translation_mm = [80, 0, 0]"), ("b", "cis", other), ("c", "dvs", ""), ("d", "cis", "")]
    rates = {"b": "set = { frame_rate_hz = 30 }", "d": "set = { frame_rate_hz = 15 }"}
    rig.write_text(
        "".join(
            f'[[camera]]\nname = "{name}"\nkind = "{kind}"\nsensor = "ideal"\n{place}\n{rates.get(name, "")}\n'
            for name, kind, place in cameras
        )
    )
    made = tmp_path / "made"
    convert(
        images(tmp_path / "in", moving(7)), made, rig=rig, depth="plane:2", pictures="png", preview=False, threads=1
    )
    sequence = open_sequence(made)
    left_out = ["b is left out: it sees other pictures than d", "a is left out: the events are those of c"]
    assert sequence.remarks == [f"its camera {said}" for said in left_out] and not sequence.apart
    told = interpolate(made, tmp_path / "out", multiple=2)
    assert told["size"] == [*SIZE] and told["key_frames"] == len(sequence.times_us)
    for k in range(told["key_frames"]):
        frame = read_codes(made / "d" / "frames" / f"{k:06d}.png")
        np.testing.assert_array_equal(sequence.frame(k), frame)
        np.testing.assert_array_equal(read_codes(tmp_path / "out" / f"{2 * k:06d}.png"), frame)
    start_us, stop_us = sequence.covered_us
    same(sequence.events(start_us, stop_us).within(SIZE)[0], Events.concatenate(read_events(made / "c")))


@pytest.mark.parametrize(("model", "apart"), [("none", False), ("radtan", False), ("equidistant", True)])
def test_cameras_in_one_place_see_the_same_through_the_same_lens(tmp_path: Path, model: str, apart: bool) -> None:
    """A fisheye lens is another than none, its coefficients may be 0."""
    cameras = [f'[[camera]]\nname = "{kind}"\nkind = "{kind}"\nsensor = "ideal"\n' for kind in ("cis", "dvs")]
    lens = f'distortion_model = "{model}"\ndistortion = {[] if model == "none" else [0, 0, 0, 0]}\n'
    (tmp_path / "rig.toml").write_text(cameras[0] + cameras[1] + lens)
    made = tmp_path / "made"
    convert(images(tmp_path / "in", moving(3)), made, rig=tmp_path / "rig.toml", preview=False, threads=1)
    assert open_sequence(made).apart == apart


@pytest.mark.parametrize("other", [(15, 1000, ""), (60, 1000, ""), (36, 0, ""), (60, 0, ", colour = false")])
def test_key_frames_are_all_pictures_of_the_slower_camera_whenever_the_other_one_takes_its_own(
    tmp_path: Path, other: tuple[int, int, str]
) -> None:
    """Which it may never do at the same instant, or at every other one, and without colours."""
    exposure_us = 8000 if other[1] else 0
    cameras = {
        "a": f"frame_rate_hz = 15, exposure_us = {exposure_us}",
        "b": "frame_rate_hz = {}, exposure_us = {}{}".format(*other),
    }
    rig = tmp_path / "rig.toml"
    rig.write_text(
        '[[camera]]\nname = "dvs"\nkind = "dvs"\nsensor = "ideal"\n'
        + "".join(
            f'[[camera]]\nname = "{name}"\nkind = "cis"\nsensor = "ideal"\nset = {{ {numbers} }}\n'
            for name, numbers in cameras.items()
        )
    )
    made = tmp_path / "made"
    convert(images(tmp_path / "in", moving(9)), made, rig=rig, pictures="png", preview=False, threads=1)
    pictures = sorted((made / "a" / "frames").glob("*.png"))
    told = interpolate(made, tmp_path / "out", multiple=2, method="linear")
    assert told["key_frames"] == len(pictures) == 4
    for k, picture in enumerate(pictures):
        np.testing.assert_array_equal(read_codes(tmp_path / "out" / f"{2 * k:06d}.png"), read_codes(picture))


def test_a_recording_that_cannot_be_interpolated_says_what_it_lacks(tmp_path: Path) -> None:
    source, rig = images(tmp_path / "in", moving(4)), tmp_path / "rig.toml"
    rig.write_text('[[camera]]\nname = "a"\nkind = "cis"\n')
    for name, options, sentence in (
        ("events", {}, "a recording without frames; convert its video with --frames$"),
        (
            "film",
            {"frame_camera": True, "pictures": ["mp4"]},
            "in a film alone.* convert its video with --cis-out raw$",
        ),
        ("inside", {"formats": ["csv", "aedat4"]}, r"without frames of a frame camera; give .*inside/events\.aedat4,"),
        ("frames", {"rig": rig, "pictures": ["png"]}, "of frames alone.* with an event camera"),
    ):
        convert(source, tmp_path / name, preview=False, threads=1, **options)
        with pytest.raises(DataError, match=sentence):
            interpolate(tmp_path / name, tmp_path / "out", multiple=2)


def test_events_of_a_camera_that_stands_elsewhere_are_said_to_be_brought(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = tmp_path / "rig.toml"
    cameras = [f'[[camera]]\nname = "{kind}"\nkind = "{kind}"\n' for kind in ("dvs", "cis")]
    rig.write_text(cameras[0] + "translation_mm = [15, 0, 0]\nsize = [32, 24]\n" + cameras[1])
    convert(
        images(tmp_path / "in", moving(5)), tmp_path / "apart", rig=rig, depth="plane:2", pictures="png",
        preview=False, threads=1, cis="ideal", overrides=["cis.frame_rate_hz=15"],
    )  # fmt: skip
    told = interpolate(tmp_path / "apart", tmp_path / "out", multiple=2)
    assert told["source"]["event_size"] == [32, 24] and read_codes(tmp_path / "out" / "000001.png").shape[1] == SIZE[0]
    assert any("stand apart" in remark for remark in told["remarks"])
    lens = Intrinsics.of_field(SIZE, 60.0)
    (look,) = open_sequence(tmp_path / "apart").looks(0)
    assert look.exact and look.where.shape == (SIZE[1], SIZE[0], 2)
    x, y = np.meshgrid(*(np.arange(side) for side in SIZE))  # at 2 m 15 mm are so many pixels, of half as many
    moved = x - lens.focal_px[0] * 0.015 / 2
    np.testing.assert_allclose(look.where, np.stack([(moved + 0.5) / 2 - 0.5, (y + 0.5) / 2 - 0.5], -1), atol=1e-3)
    told = interpolate(tmp_path / "apart", tmp_path / "flow", multiple=2, method="flow")
    assert not any("stand apart" in remark for remark in told["remarks"])  # (it asks for no events)
    monkeypatch.setattr(OfSequence, "events", lambda *_: None)  # (as where their files are missing)
    told = interpolate(tmp_path / "apart", tmp_path / "unknown", multiple=2)
    assert NO_EVENTS in told["gaps_s"] and not any("stand apart" in remark for remark in told["remarks"])


@pytest.mark.parametrize(("dvs_us", "cis_us"), [(0, 0), (700, 700), (1500, 0), (-200, 100)])
def test_events_by_a_clock_that_is_known_to_be_late_are_said_to_be(tmp_path: Path, dvs_us: int, cis_us: int) -> None:
    """In a rig; of cameras of one clock nothing is said, and nothing where no events are asked for."""
    rig = tmp_path / "rig.toml"
    cameras = (("dvs", dvs_us), ("cis", cis_us))
    rig.write_text("".join(f'[[camera]]\nname = "{k}"\nkind = "{k}"\nclock_offset_us = {us}\n' for k, us in cameras))
    convert(
        images(tmp_path / "in", moving(5)), tmp_path / "made", rig=rig, pictures="png", preview=False, threads=1,
        cis="ideal", overrides=["cis.frame_rate_hz=15"],
    )  # fmt: skip
    said = {
        method: " ".join(interpolate(tmp_path / "made", tmp_path / method, multiple=2, method=method)["remarks"])
        for method in ("bridge", "flow")
    }
    late_us = dvs_us - cis_us
    expected = f"{abs(late_us)} us {'late' if late_us > 0 else 'early'} by the clock of its frames"
    assert (expected in said["bridge"]) == ("clock" in said["bridge"]) == bool(late_us) and "clock" not in said["flow"]


def test_events_are_looked_for_where_a_map_of_that_instant_says(tmp_path: Path) -> None:
    """A camera beside a scene whose depth is known; without the maps, as if it were far away."""
    rig = tmp_path / "rig.toml"
    cameras = [f'[[camera]]\nname = "{name}"\nkind = "{kind}"\n' for name, kind in (("a", "dvs"), ("b", "cis"))]
    rig.write_text(f"{cameras[0]}translation_mm = [80, 0, 0]\n{cameras[1]}")
    made, scene = tmp_path / "made", "scene:parallax,size=48x32"
    convert(scene, made, rig=rig, stop=0.12, truth="map", pictures="png", preview=False, threads=1)
    sequence, maps = open_sequence(made), sorted((made / "b" / "truth" / "map_a").glob("*.npz"))
    times_us = [int(line) for line in (made / "b" / "truth" / "timestamps.txt").read_text().split()]
    assert len(maps) == len(times_us) > 2
    for path, t_us in zip(maps, times_us, strict=True):
        stands, look = sequence.looks(t_us + 3)
        assert not stands.exact and not look.exact
        known = read_pixel_map(path)
        seen = ~np.isnan(known)
        np.testing.assert_array_equal(look.where.numpy()[seen], known[seen])
    (far,) = sequence.looks(times_us[-1] + 60_000)
    assert torch.equal(far.where, stands.where) and np.abs(far.where.numpy() - look.where.numpy()).max() > 1
    write_pixel_map(maps[0], np.zeros((5, 4, 2), np.float32))
    with pytest.raises(DataError, match="4x5 pixels, expected 48x32 as frames have"):
        sequence.looks(times_us[0])
    (made / "b" / "truth" / "timestamps.txt").write_text("soon\n")
    with pytest.raises(DataError, match="does not say what it should"):
        open_sequence(made)


def test_a_calibration_that_does_not_fit_its_pictures_is_said(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    cameras = [f'[[camera]]\nname = "{name}"\nkind = "{kind}"\n' for name, kind in (("a", "dvs"), ("b", "cis"))]
    rig.write_text(f"{cameras[0]}translation_mm = [80, 0, 0]\n{cameras[1]}")
    made = tmp_path / "made"
    source = images(tmp_path / "in", moving(5))
    convert(source, made, rig=rig, depth="plane:2", pictures="png", preview=False, threads=1)
    said = json.loads((made / "manifest.json").read_text())
    lens = next(each for each in said["rig"]["cameras"] if each["name"] == "b")["intrinsics"]
    for wrong in ([60_000, 60_000], [8], "large"):
        text = json.dumps(said).replace(json.dumps(lens), json.dumps(lens | {"size": wrong}))
        (made / "manifest.json").write_text(text)
        with pytest.raises(DataError, match=r"manifest.json does not say what it should"):
            open_sequence(made)


def still_and_events() -> tuple[np.ndarray, Events, np.ndarray]:
    """Light [32, H, W] whose logs go in steps of 0.2, the events of the steps, and its mean."""
    draw = np.random.default_rng(0)
    steps = draw.integers(-1, 2, (32, *SIZE[::-1])) * (draw.random((32, *SIZE[::-1])) < 0.1)
    steps[0] = 0
    light = 0.2 * np.exp(0.2 * np.cumsum(steps, 0)) - 1e-3
    k, y, x = np.nonzero(steps)
    t = 1000 * k + 1
    order = np.argsort(t, kind="stable")
    p = (steps[k, y, x] > 0).astype(np.uint8)
    return light, Events(t[order], x[order].astype(np.uint16), y[order].astype(np.uint16), p[order]), light.mean(0)


def test_a_blurred_frame_and_its_events_give_back_the_light_of_each_instant() -> None:
    light, events, mean = still_and_events()
    from interp.representation.event_counts import count_events

    frame = to_codes(torch.from_numpy(mean[None].astype(np.float32)), "srgb")
    counts = count_events(events, SIZE, 0, 32_000, 32, (0.2, 0.2))
    times = torch.tensor([1.5, 10.5, 31.5]) / 32
    found = to_light(OneFrame("deblur").between(Gap(frame, frame, counts), times), "srgb")
    # (counts say in which thirty-second of the exposure an event came: half of its step has been made in the middle)
    for image, k in zip(found, (1, 10, 31), strict=True):
        quiet = light[k] == light[k - 1]
        assert np.abs(np.log((image[0].numpy() + 1e-3) / (light[k] + 1e-3)))[quiet].max() < 0.03
    sharp = OneFrame("integration").between(Gap(frame, frame, counts), torch.tensor([0.5]))
    torch.testing.assert_close(sharp[0], frame, atol=1e-5, rtol=0)
    none = EventCounts.none(1, SIZE[::-1])
    for name in ("deblur", "integration"):
        same_frame = OneFrame(name).between(Gap(frame, frame, none), times)
        torch.testing.assert_close(same_frame, frame.expand(3, -1, -1, -1), atol=1e-5, rtol=0)


@pytest.mark.parametrize("name", ["deblur", "integration"])
@pytest.mark.parametrize("most", [1, 20])
def test_a_single_frame_is_the_same_whichever_way_time_goes(name: Literal["deblur", "integration"], most: int) -> None:
    """Pixels that are stuck are as bright as light may be, or black, and change nothing of the others."""
    off_on = torch.zeros(1, 2, 32, 8, 8)
    off_on[..., 1:, 1:] = torch.poisson(torch.full((1, 2, 32, 7, 7), 0.1))
    stuck = off_on.clone()
    stuck[:, 1, :, 0, 0] = stuck[:, 0, :, 0, 1] = stuck[:, 1, :16, 0, 2] = stuck[:, 0, 16:, 0, 2] = most
    frame, contrast = 0.3 + 0.7 * torch.rand(3, 8, 8), torch.tensor([[0.15, 0.3]])
    times = torch.tensor([0.0, 0.25, 0.5, 1.0])
    events, with_stuck = EventCounts(off_on, contrast), EventCounts(stuck, contrast)
    back = EventCounts(stuck.flip(1, 2), contrast.flip(1))
    gaps = [Gap(frame, frame, each) for each in (with_stuck, back, events)]
    forth, reverse, plain = (
        OneFrame(name).between(gap, when) for gap, when in zip(gaps, (times, 1 - times, times), strict=True)
    )
    torch.testing.assert_close(forth, reverse, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(forth[..., 1:, 1:], plain[..., 1:, 1:], atol=1e-6, rtol=0)
    light = luminance(to_light(forth, "srgb"))[:, 0]
    assert float(light.max()) < 1.2
    if most == 20:
        brightest = 1.1 if name == "deblur" else float(luminance(to_light(frame, "srgb"))[0, 0, 2])
        assert float(light[2, 0, 2]) == pytest.approx(brightest, abs=0.01)
        assert float(light[3, 0, 0]) == pytest.approx(1.1, abs=0.01) and float(light[0, 0, 0]) < 0.01


@pytest.mark.parametrize("kind", ["mat", "mat-beside", "npz"])
def test_a_single_frame_with_events_makes_frames_of_its_exposure(tmp_path: Path, kind: str) -> None:
    _, events, mean = still_and_events()
    write_codes(tmp_path / "a.png", np.rint(255 * mean / mean.max()).astype(np.uint8))
    if kind != "npz":
        table = np.stack([events.t, events.x, events.y, events.p], 1).astype(np.int64)
        savemat(tmp_path / "a.mat", {"events": table})
        source, options = tmp_path / ("a.mat" if kind == "mat" else "a.png"), Options()
    else:
        source, options = tmp_path / "a.png", Options(events=written(tmp_path / "e.npz", events))
    heard: list[tuple[int, int | None]] = []
    for grid in ({"multiple": "2.5"}, {"fps": 500}, {"fps": 491}, {"multiple": 6}):
        told = interpolate(
            source,
            tmp_path / "out",
            **grid,
            options=options,
            overwrite=True,
            report=lambda *so_far: heard.append(so_far),
        )
        assert heard[-1] == (told["frames"], told["frames"])
    assert told["interpolation"] == {"method": "deblur"} and told["frames"] == 6
    assert any("single frame" in remark for remark in told["remarks"])
    assert read_codes(tmp_path / "out" / "000003.png").shape == SIZE[::-1]
    with pytest.raises(UsageError, match='transfer = "srgb", not "linear"'):
        interpolate(source, tmp_path / "out", multiple=6, options=replace(options, transfer="linear"), resume=True)
    with pytest.raises(UsageError, match="takes two frames"):
        interpolate(source, tmp_path / "flow", method="flow", options=options)
    with pytest.raises(UsageError, match="'any' takes two frames"):
        interpolate(source, tmp_path / "flow", method="deblur", network="any", options=options)
    assert not (tmp_path / "flow").exists()


@pytest.mark.parametrize("stated", [(32, 24), (128, 96)])
def test_events_of_a_sensor_that_states_its_size_lie_over_all_of_a_single_frame(
    tmp_path: Path, stated: tuple[int, int]
) -> None:
    write_codes(tmp_path / "a.png", np.full(SIZE[::-1], 99, np.uint8))
    some, reach = drawn(), np.array([[20], [15]])
    x, y = (np.stack([some.x, some.y]) % reach).astype(np.uint16)
    blocks = [Events(some.t, x, y, some.p)]
    write = format_named("npz").write
    assert write is not None
    write(tmp_path / "e.npz", Recording(stated, 0, int(some.t[-1]), len(some), lambda: iter(blocks)))
    options = Options(events=tmp_path / "e.npz")
    assert open_take(tmp_path / "a.png", options).event_size == stated
    (first, *_) = frames(tmp_path / "a.png", multiple=2, options=options)
    seen = np.argwhere(np.abs(first.codes[..., 0] - 99 / 255) > 1e-3).max(0)
    np.testing.assert_allclose(seen + 1, reach[::-1, 0] * SIZE[0] / stated[0], atol=1.5)


def test_events_of_a_single_frame_are_put_in_order_of_time(tmp_path: Path) -> None:
    write_codes(tmp_path / "a.png", np.full(SIZE[::-1], 99, np.uint8))
    some, takes = drawn(), []
    for name, shift in (("in-order", 0), ("not", 1000)):
        each = Events(*(np.roll(getattr(some, column), shift) for column in "txyp"))
        lines = (",".join(map(str, event)) for event in zip(each.t, each.x, each.y, each.p, strict=True))
        (tmp_path / f"{name}.csv").write_text("t,x,y,p\n" + "\n".join(lines) + "\n")
        takes.append(open_take(tmp_path / "a.png", Options(events=tmp_path / f"{name}.csv")))
    times = [[key.t_us for key in take.keys(0)] for take in takes]
    assert times[0] == times[1] == [int(some.t[0]), int(some.t[-1])]
    same(*(take.events(*times[0]) for take in takes))
    assert ["put in order" in " ".join(take.remarks) for take in takes] == [False, True]


def test_a_single_frame_of_floating_point_is_light(tmp_path: Path) -> None:
    light = np.full(SIZE[::-1], 0.5, np.float32)
    light[0, :3] = np.nan, np.inf, 3
    cv2.imwrite(str(tmp_path / "a.tiff"), light)
    (key, _) = open_take(tmp_path / "a.tiff", Options(events=written(tmp_path / "e.npz", drawn()))).keys()
    found = to_light(torch.from_numpy(key.codes[..., 0]), "srgb").numpy()
    np.testing.assert_allclose(found[1:], 0.5, rtol=1e-5)
    np.testing.assert_allclose(found[0, :3], [0, 65504, 3], rtol=1e-4)


def test_a_tiff_of_pages_with_events_is_no_single_frame(tmp_path: Path) -> None:
    cv2.imwritemulti(str(tmp_path / "a.tif"), moving(4))
    np.save(tmp_path / "a_timestamps.npy", 1e-6 * STEP_US * np.arange(4))
    take = open_take(tmp_path / "a.tif", Options(events=written(tmp_path / "e.npz", drawn())))
    assert take.gaps_expected == 3 and [key.t_us for key in take.keys(0)] == [STEP_US * k for k in range(4)]


@pytest.mark.parametrize(
    ("name", "options", "error", "sentence"),
    [
        ("alone.mat", {}, UsageError, "no picture beside it"),
        ("broken.mat", {}, DataError, "cannot be read as a MATLAB file"),
        ("other.mat", {}, DataError, "expected a table"),
        ("negative.mat", {}, DataError, "in this order"),
        ("unknown.mat", {}, DataError, "no numbers"),
        ("seconds.mat", {}, DataError, "multiply seconds by 1e6"),
        ("late.mat", {}, DataError, "events from 9.22337e.18 to 9.22337e.18 us; expected times within"),
        ("early.mat", {}, DataError, "events from -1e.19 to -1e.19 us; expected times within"),
        ("events.npz", {}, UsageError, "holds no frames"),
        ("events.npz", {"events": Path("events.npz")}, UsageError, "events of its own"),
        ("still.png", {"events": Path("nothing.npz")}, UsageError, "no such file"),
        ("still.png", {"events": Path("events.npz"), "transfer": "linear:10bit"}, UsageError, "10 bits of uint8"),
    ],
)
def test_what_is_no_take_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, options: dict[str, Any], error: Any, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    picture = np.zeros(SIZE[::-1], np.uint8)
    for stem in ("broken", "other", "negative", "unknown", "seconds", "late", "early", "still"):
        write_codes(tmp_path / f"{stem}.png", picture)
    savemat(tmp_path / "alone.mat", {"events": np.ones((5, 4))})
    savemat(tmp_path / "other.mat", {"light": np.ones((5, 3))})
    savemat(tmp_path / "negative.mat", {"events": -np.ones((5, 4))})
    savemat(tmp_path / "unknown.mat", {"events": np.full((5, 4), np.nan)})
    savemat(tmp_path / "seconds.mat", {"events": np.linspace(1.5, 1.53, 5)[:, None] * [1, 0, 0, 0]})
    savemat(tmp_path / "late.mat", {"events": np.array([[2**63, 0, 0, 1], [2**63 + 4000, 0, 0, 1]], np.uint64)})
    savemat(tmp_path / "early.mat", {"events": np.array([[-1e19, 0, 0, 1], [-1e19 + 4000, 0, 0, 1]])})
    (tmp_path / "broken.mat").write_bytes((tmp_path / "alone.mat").read_bytes()[:150])
    written(tmp_path / "events.npz", drawn(100))
    with pytest.raises(error, match=sentence) as found:
        open_take(name, Options(**options))
    assert "\n" not in str(found.value)


def test_a_manifest_says_all_that_decided_the_frames(tmp_path: Path) -> None:
    source, events = images(tmp_path / "in", moving(3)), written(tmp_path / "a.npz", drawn())
    interpolate(source, tmp_path / "out", multiple=2, options=Options(events=events))
    said = json.loads((tmp_path / "out" / "frames.json").read_text())
    assert said["grid"] == {"multiple": "2"} and said["source"]["events"]["identity"]["sha256"]
    assert said["key_frames"] == 3 and said["frames"] == 5 and "torch" in said["versions"]
