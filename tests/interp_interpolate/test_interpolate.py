"""What `interpolate` makes: key frames as they came, held cuts, gaps without events, refusals."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from fractions import Fraction
from inspect import signature
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from click.testing import CliRunner
from small_takes import SIZE, STEP_US, images, moving, recording, strange, texture, times_of

from interp import pretrained
from interp.commands.interpolate import interpolate as command
from interp.interpolate import frames, interpolate
from interp.interpolate.fill import Filled
from interp.interpolate.instants import Instant
from interp.interpolate.pictures import Pictures
from interp.interpolate.take import Options, open_take
from interp.methods import METHODS, open_method
from interp.methods.one_frame import WAYS
from interp.networks import make
from interp.own_codes import shown
from interp.weights import save
from vid2ev import open_source
from vid2ev.errors import DataError, UsageError
from vid2ev.pictures.film import SLOWEST_HZ
from vid2ev.recording.exposures import read_codes, write_codes


def never(*_: object) -> None:
    raise AssertionError("a frame is made")


def made(folder: Path) -> list[np.ndarray]:
    return [read_codes(path) for path in sorted(folder.glob("*.png"))]


@pytest.mark.parametrize(("multiple", "every"), [(2, 2), (7, 7), ("2.5", 5)])
@pytest.mark.parametrize("kind", ["images", "recording"])
def test_key_frames_are_there_bit_for_bit(tmp_path: Path, multiple: object, every: int, kind: str) -> None:
    frames = moving(5)
    source = images(tmp_path / "in", frames) if kind == "images" else recording(tmp_path / "in", frames)
    told = interpolate(source, tmp_path / "out", multiple=multiple, method="linear")
    keys = range(0, 5, 1 if every != 5 else 2)
    out, times = made(tmp_path / "out"), times_of(tmp_path / "out")
    assert told["frames"] == len(out) == len(times)
    for k in keys:
        np.testing.assert_array_equal(out[int(k * float(str(multiple)))], frames[k])
        assert times[int(k * float(str(multiple)))] == STEP_US * k


def test_the_size_that_is_said_is_that_of_the_film(tmp_path: Path) -> None:
    source = images(tmp_path / "a", [frame[:, :63] for frame in moving(2)])
    told = interpolate(source, tmp_path / "film.mp4", multiple=2, method="linear")
    assert tuple(told["size"]) == open_source(tmp_path / "film.mp4").size == (64, 48)
    assert "so the last column of 63x48 is there twice" in told["remarks"][-1]
    assert interpolate(source, tmp_path / "b", multiple=2, method="linear")["size"] == [63, 48]


@pytest.mark.parametrize("curve", ["srgb", "bt709", "gamma:0.5", "gamma:1.0", "gamma:2.2", "gamma:2.8", "gamma:10"])
@pytest.mark.parametrize("kind", ["png", "mp4"])
def test_codes_of_key_frames_are_those_of_their_curve(kind: str, curve: str) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, 2)
    key = Filled(Instant(0, 0, Fraction(0)), True, 0, shown(codes, curve))
    np.testing.assert_array_equal(Pictures(kind, 8, curve).picture(key), codes)


def test_frames_of_16_bits_and_grey_ones_stay_what_they_are(tmp_path: Path) -> None:
    deep = [(np.random.default_rng(k).integers(0, 65536, (32, 40, 3))).astype(np.uint16) for k in range(2)]
    interpolate(images(tmp_path / "deep", deep), tmp_path / "out16", multiple=2, method="linear", cuts="keep")
    grey = [frame[..., 0] for frame in moving(2)]
    interpolate(images(tmp_path / "grey", grey), tmp_path / "out8", multiple=2, method="linear")
    for source, folder in ((deep, "out16"), (grey, "out8")):
        out = made(tmp_path / folder)
        for found, frame in zip(out[::2], source, strict=True):
            np.testing.assert_array_equal(found, frame)
        middle = (source[0].astype(float) + source[1]) / 2
        assert np.abs(out[1] - middle).max() <= 0.51 and out[1].dtype == source[0].dtype


@pytest.mark.parametrize("method", METHODS)
def test_where_nothing_happens_all_frames_are_the_key_frame(tmp_path: Path, method: str) -> None:
    frame = texture()[:, : SIZE[0]]
    source = recording(tmp_path / "in", [frame] * 3)
    for path in (source / "events_aligned").iterdir():  # (all events beside the frames: they say when it was recorded)
        columns = dict(np.load(path))
        np.savez(path, **(columns | {"x": columns["x"] + np.float32(SIZE[0] + 0.5)}))
    told = interpolate(source, tmp_path / "out", multiple=4, method=method)
    assert not told["gaps_s"]
    for found in made(tmp_path / "out"):
        np.testing.assert_array_equal(found, frame)


def test_the_help_names_every_method_and_those_that_need_events() -> None:
    shown = next(option.help for option in command.params if option.name == "method").partition(".")[0]
    of_two, of_one = shown.split("; of a single frame ")
    assert of_one.split(" or ") == list(WAYS)
    frames, events = (re.findall(r"\w+", part) for part in of_two.split(" or with events "))
    needs = dict.fromkeys(frames, False) | dict.fromkeys(events, True)
    assert needs == {name: open_method(name).needs_events for name in METHODS}


def test_nothing_is_interpolated_across_a_cut(tmp_path: Path) -> None:
    frames = [*moving(4, seed=1), *moving(4, seed=2)]
    for name, source in (
        ("images", images(tmp_path / "a", frames)),
        ("recording", recording(tmp_path / "b", frames)),
    ):
        told = interpolate(source, tmp_path / f"{name}_out", multiple=4)
        assert told["gaps_s"] == {"a cut": [[3 * STEP_US / 1e6, 4 * STEP_US / 1e6]]}
        out = made(tmp_path / f"{name}_out")
        for number in (12, 13, 14):
            np.testing.assert_array_equal(out[number], frames[3])
        for number in (15, 16):
            np.testing.assert_array_equal(out[number], frames[4])
    told = interpolate(tmp_path / "a", tmp_path / "keep", multiple=4, method="linear", cuts="keep")
    assert not told["gaps_s"] and not np.array_equal(made(tmp_path / "keep")[13], frames[3])


OTHERWISE: dict[str, Any] = {  # (begun with -x 2, linear, and events a.npz)
    "start_s": 0.03, "stop_s": 0.04, "crop": "32x24+1+1", "size": "32x24", "transfer": "linear",
    "source_hz": Fraction(25), "contrast": (0.2, 0.3), "refractory_us": 500.0, "events": Path("b.npz"),
    "multiple": 3, "fps": 60, "method": "nearest", "network": "rrin_light-tiny", "hdr": "hdr-tiny", "cuts": "keep",
    "format": "exr", "tile": "64x64",
}  # fmt: skip
ANY_TIME = {"output", "overwrite", "resume", "report", "told"}


def test_with_another_value_of_any_option_nothing_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    of_source = {field.name for field in fields(Options)}
    known = {*signature(interpolate).parameters} - ANY_TIME - {"options"} | of_source
    assert known - {*OTHERWISE} == {"source", "device", "running", "play"}  # (running is of networks, play of films)
    images(Path("a"), [frame.repeat(3, 0).repeat(3, 1) for frame in moving(3)])
    for name, t in (("a.npz", np.array([9, 40_000])), ("b.npz", np.array([9, 50_000]))):
        np.savez(name, t=t, **{column: np.ones(2, np.uint8) for column in "xyp"}, width=64, height=48)
    began: dict[str, Any] = {"multiple": 2, "method": "linear", "options": Options(events=Path("a.npz"))}
    interpolate("a", "out", **began)
    interpolate("a", "out", resume=True, **began)
    for name, value in OTHERWISE.items():
        options = replace(began["options"], **{name: value} if name in of_source else {})
        asked = began | {"options": options} | ({} if name in of_source else {name: value})
        taken = {"fps": "multiple", "network": "method"}.get(name)  # (whose place it takes)
        with pytest.raises(UsageError, match="out was begun with "):
            interpolate("a", "out", resume=True, **{key: asked[key] for key in asked if key != taken})


def test_gaps_of_which_no_events_are_known_are_named(tmp_path: Path) -> None:
    source = recording(tmp_path / "in", moving(5), until=2)
    told = interpolate(source, tmp_path / "out", multiple=2, method="bridge")
    assert told["interpolation"]["method"] == "bridge"
    seconds = [STEP_US * k / 1e6 for k in range(5)]
    assert told["gaps_s"] == {"events that are not known": [[seconds[2], seconds[3]], [seconds[3], seconds[4]]]}
    flow = interpolate(source, tmp_path / "flow", multiple=2, method="flow")
    assert not flow["gaps_s"]
    np.testing.assert_array_equal(made(tmp_path / "out")[5], made(tmp_path / "flow")[5])


def test_pictures_that_have_nothing_in_common_are_held_where_their_events_are_not_known(tmp_path: Path) -> None:
    """There is nothing to go by: neither motion nor events."""
    told = interpolate(recording(tmp_path / "in", strange(), until=1), tmp_path / "out", multiple=4, method="bridge")
    seconds = [STEP_US * k / 1e6 for k in range(4)]
    assert told["gaps_s"] == {"pictures that have nothing in common": [seconds[1:3], seconds[2:]]}
    for k, found in enumerate(made(tmp_path / "out")[4:], 4):
        np.testing.assert_array_equal(found, strange()[k // 4 + (k % 4 == 3)])


def test_what_remembers_begins_anew_after_events_that_are_not_known(tmp_path: Path) -> None:
    save(tmp_path / "net.safetensors", "firenet", make("firenet"))
    source = recording(tmp_path / "in", moving(6))
    (source / "events_aligned" / "000002.npz").unlink()
    whole, part = (
        [*frames(source, multiple=2, network=tmp_path / "net.safetensors", options=Options(start_s=start_s))]
        for start_s in (None, 4 * STEP_US / 1e6)
    )
    for one, other in zip(whole[8:], part, strict=True):
        np.testing.assert_array_equal(one.codes, other.codes)


def test_a_part_begins_and_ends_at_frames(tmp_path: Path) -> None:
    frames = moving(6)
    for name, source in (("a", images(tmp_path / "a", frames)), ("b", recording(tmp_path / "b", frames))):
        options = Options(start_s=STEP_US / 1e6, stop_s=3.5 * STEP_US / 1e6)
        told = interpolate(source, tmp_path / f"{name}_out", multiple=2, method="linear", options=options)
        assert told["key_frames"] == 3 and told["start_us"] == STEP_US and told["stop_us"] == 3 * STEP_US
        np.testing.assert_array_equal(made(tmp_path / f"{name}_out")[0], frames[1])


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("method", ["linear", "flow"])
def test_a_part_of_images_is_that_part_of_what_the_whole_becomes(tmp_path: Path, method: str, bits: int) -> None:
    pictures = [picture.astype(f"u{bits // 8}") * (257 if bits == 16 else 1) for picture in moving(4)]
    source = images(tmp_path / "in", pictures)
    whole = [frame.codes for frame in frames(source, multiple=2, method=method)]
    part = [*frames(source, multiple=2, method=method, options=Options(start_s=STEP_US / 1e6))]
    assert all(np.array_equal(frame.codes, codes) for frame, codes in zip(part, whole[2:], strict=True))
    if method == "linear":  # (motion is sought in what is seen)
        cropped = frames(source, multiple=2, method=method, options=Options(crop="20x30+7+5"))
        assert all(np.array_equal(frame.codes, codes[5:35, 7:27]) for frame, codes in zip(cropped, whole, strict=True))


def test_a_folder_of_frames_is_a_source_again(tmp_path: Path) -> None:
    interpolate(images(tmp_path / "in", moving(3), step_us=120), tmp_path / "out", multiple=4)
    times = [frame.t_ns for frame in open_source(tmp_path / "out").frames()]
    assert times == [30_000 * k for k in range(9)]  # (microseconds, though their spacing looks like milliseconds)


def test_more_frames_than_microseconds_leave_nothing_wherever_they_are_found(tmp_path: Path) -> None:
    source = images(tmp_path / "in", moving(4), step_us=100)
    for times in ("0\n50\n100\n150\n", "0\n100\n200\n250\n"):  # (us: at once, and after two gaps of three)
        (source / "timestamps.txt").write_text(f"# us\n{times}")
        for name in ("out", "out.mp4"):
            with pytest.raises(UsageError, match="50 us apart: more than one in a microsecond; choose fewer"):
                interpolate(source, tmp_path / name, multiple=75, method="nearest")
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_film_shows_the_frames_and_exr_their_light(tmp_path: Path) -> None:
    frames = moving(4)
    source = images(tmp_path / "in", frames)
    told = interpolate(source, tmp_path / "film.mp4", multiple=2)
    assert json.loads((tmp_path / "film.json").read_text())["frames"] == told["frames"] == 7
    film = open_source(tmp_path / "film.mp4")
    seen = [frame.light for frame in film.frames()]
    assert len(seen) == 7 and film.size == SIZE
    truth = [frame.light for frame in open_source(source).frames()]
    for key, light in zip(seen[::2], truth, strict=True):
        assert np.abs(key - light).mean() < 0.02  # (the film has lost a little)
    truth = [frame.light for frame in open_source(source, colour="rgb").frames()]
    pytest.importorskip("OpenEXR")
    interpolate(source, tmp_path / "light", multiple=2, format="exr")
    again = [frame.light for frame in open_source(tmp_path / "light", colour="rgb").frames()]
    for key, light in zip(again[::2], truth, strict=True):
        np.testing.assert_allclose(key, light, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("curve", ["srgb", "bt709", "gamma:2.2", "gamma:1.5", "gamma:4", "linear"])
def test_a_film_is_as_bright_as_its_source_by_whatever_curve(tmp_path: Path, curve: str) -> None:
    """Also by one that no film can say it has."""
    source = images(tmp_path / "in", [np.full_like(frame, 90 + 60 * k) for k, frame in enumerate(moving(2))])
    interpolate(source, tmp_path / "film.mp4", multiple=1, method="nearest", options=Options(transfer=curve))
    for made, first in zip(*(open_source(path, **of).frames() for path, of in (
        (tmp_path / "film.mp4", {}), (source, {"transfer": curve})
    )), strict=True):  # fmt: skip
        np.testing.assert_allclose(made.light, first.light, rtol=0.05)


@pytest.mark.parametrize("uneven", [False, True])
def test_a_film_that_plays_frames_evenly_which_are_not_says_so(tmp_path: Path, uneven: bool) -> None:
    source = images(tmp_path / "in", moving(4))
    times_us = [0, 20_000, 53_000, 70_000] if uneven else [0, 33_333, 66_667, 100_000]
    (source / "timestamps.txt").write_text("# us\n" + "".join(f"{t}\n" for t in times_us))
    for output, grid in (("a.mp4", {"multiple": 3}), ("b.mp4", {"fps": 90}), ("c", {"multiple": 3})):
        told = interpolate(source, tmp_path / output, method="linear", **grid)
        assert any("17 to 33 ms apart" in text for text in told["remarks"]) == (uneven and output == "a.mp4")


@pytest.mark.parametrize(
    ("times_us", "even"),
    [
        ([0, 17_000, 33_000, 50_000], True),
        ([0, 8_000, 17_000, 25_000], True),
        ([0, 1_000, 3_000, 4_000], False),
        ([0, 16_000, 34_000, 50_000], False),  # (more than rounding makes)
        ([0, 10_000, 20_900, 30_900], False),  # (as little, but not of whole milliseconds)
        ([0, 10_000, 20_400, 30_400], True),  # (by less than a twentieth)
    ],
)
def test_frames_at_a_constant_rate_whose_file_rounds_times_are_even(
    tmp_path: Path, times_us: list[int], even: bool
) -> None:
    source = images(tmp_path / "in", moving(4))
    (source / "timestamps.txt").write_text("# us\n" + "".join(f"{t}\n" for t in times_us))
    told = interpolate(source, tmp_path / "film.mp4", multiple=2, method="linear")
    assert any("ms apart" in text for text in told["remarks"]) != even


def test_the_default_is_said_with_its_reason(tmp_path: Path) -> None:

    said: list[str] = []
    interpolate(images(tmp_path / "a", moving(2)), tmp_path / "out", multiple=1, told=said.append)
    interpolate(recording(tmp_path / "b", moving(2)), tmp_path / "out2", multiple=1, told=said.append)
    with pytest.raises(UsageError, match="out exists"):
        interpolate(tmp_path / "a", tmp_path / "out", multiple=1, told=said.append)
    interpolate(tmp_path / "a", tmp_path / "out", multiple=1, told=said.append, resume=True)  # (is there)
    weights = pretrained.first(pretrained.WITH_EVENTS)
    assert weights
    for sentence, name in zip(said, ("flow", weights.stem), strict=True):
        assert sentence.startswith(name) and "since there are" in sentence


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["nowhere"], 2, "no such file"),
        (["a", "-x", "many"], 2, "expected a number"),
        (["a", "-x", "2", "--fps", "60"], 2, "leave out one"),
        (["a", "--method", "bridge"], 2, "needs events"),
        (["a", "--method", "brige"], 2, "did you mean bridge"),
        (["a", "--contrast", "0.2"], 2, "has none"),
        (["a", "--refractory", "100"], 2, "has none"),
        (["b", "--refractory", "-1"], 2, "expected 1 to"),
        (["b", "--contrast", "much"], 2, "expected nats"),
        (["b", "--size", "32"], 2, "leave --size out"),
        (["b", "--transfer", "linear"], 2, "leave --transfer out"),
        (["b", "--source-fps", "30"], 2, "leave --source-fps out"),
        (["a", "--tile", "8x8"], 2, "expected none, auto"),
        (["a", "-o", "out.avi"], 2, "cannot be made"),
        (["a", "-o", "out", "--play", "30"], 2, "is of films"),
        (["a/000000.png"], 2, "give the folder that holds the sequence, or its events with --events"),
        (["a", "-o", "out", "--format", "mp4"], 2, "ends in .mp4"),
        (["a", "-o", "a"], 2, "exists"),
        (["a", "--network", "rrin_light"], 2, "did you mean rrin_light-tiny"),
        (["a", "--hdr-network", "nothing"], 2, "none of those that come"),
        (["a", "--network", "weights.safetensors"], 1, "cannot be read as weights"),
        (["a", "--network", "hdr.safetensors"], 2, "rebuilds no frames"),
        (["a", "--network", "events.safetensors"], 2, "network 'events.safetensors' needs events"),
        (["a", "--hdr-network", "hdr.safetensors"], 2, "HDR by hdr needs events"),
        (["b", "--hdr-network", "events.safetensors"], 2, "network hdr"),
        (["b", "--start", "9"], 2, "expected a part of its"),
        (["b", "--start", "9", "--stop", "0"], 2, "from 9 s to 0 s; expected a part of its"),
        (["bad"], 1, "without times|pictures and"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], code: int, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    images(tmp_path / "a", moving(2))
    recording(tmp_path / "b", moving(2))
    recording(tmp_path / "bad", moving(2))
    (tmp_path / "bad" / "images_corrected" / "timestamp.txt").write_text("")
    (tmp_path / "weights.safetensors").write_bytes(b"nothing")
    for name, network in (("hdr", "hdr"), ("events", "rrin_events_light")):
        save(tmp_path / f"{name}.safetensors", network, make(network))
    before = sorted(tmp_path.rglob("*"))
    result = CliRunner().invoke(command, arguments)
    assert isinstance(result.exception, (UsageError, DataError))
    assert result.exception.exit_code == code
    message = str(result.exception)
    assert re.search(sentence, message) and "\n" not in message and message.count(". ") == 0
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("output", [".", "..", "/"])
def test_where_no_folder_can_be_put_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, output: str) -> None:
    monkeypatch.chdir(tmp_path)
    images(tmp_path / "in", moving(2))
    refused = CliRunner().invoke(command, ["in", "-o", output, "--method", "nearest"]).exception
    assert isinstance(refused, UsageError) and f"{output} cannot be renamed into place" in str(refused)
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_file_of_somebody_else_is_not_replaced_by_the_manifest_of_a_film(tmp_path: Path) -> None:
    source, beside = images(tmp_path / "in", moving(2)), tmp_path / "clip.json"
    for text in ('{"mine": 1}', "no JSON", "[]"):
        beside.write_text(text)
        for asked in ({}, {"resume": True}, {"overwrite": True}):
            with pytest.raises(UsageError, match=r"clip\.json is to be the film's manifest, and is another file"):
                interpolate(source, tmp_path / "clip.mp4", multiple=2, method="nearest", **asked)
        assert beside.read_text() == text and len(list(tmp_path.iterdir())) == 2
    beside.unlink()
    interpolate(source, tmp_path / "clip.mp4", multiple=2, method="nearest")
    interpolate(source, tmp_path / "clip.mp4", multiple=3, method="nearest", overwrite=True)
    (tmp_path / "clip.mp4").unlink()
    interpolate(source, tmp_path / "clip.mp4", multiple=2, method="nearest")  # (what is left of ours is no obstacle)


@pytest.mark.parametrize("name", ["clip.mp4", "in"])
def test_frames_do_not_take_the_place_of_what_they_are_made_of(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    interpolate(images(tmp_path / "in", moving(2)), tmp_path / "clip.mp4", multiple=2, method="nearest")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    monkeypatch.chdir(tmp_path)
    for asked in ({"overwrite": True}, {"overwrite": True, "resume": True}):
        with pytest.raises(UsageError, match="holds what it is to be made of"):
            interpolate(tmp_path / name, name, multiple=2, method="nearest", **asked)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("name", ["out", "out.mp4"])
@pytest.mark.skipif(sys.platform == "win32", reason="links need a privilege there")
def test_what_frames_cannot_take_the_place_of_is_refused_before_any_is_made(tmp_path: Path, name: str) -> None:
    source, output = images(tmp_path / "in", moving(2)), tmp_path / name
    output.symlink_to("elsewhere")
    with pytest.raises(UsageError, match="is a link"):
        interpolate(source, output, overwrite=True, report=never)
    assert output.is_symlink()
    output.unlink()
    (tmp_path / f"{name}.partial").mkdir()
    (tmp_path / f"{name}.partial" / "thesis.tex").touch()
    with pytest.raises(UsageError, match="holds other files"):
        interpolate(source, output, overwrite=True, report=never)
    assert [path.name for path in (tmp_path / f"{name}.partial").iterdir()] == ["thesis.tex"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are no pipes that have names")
def test_a_pipe_is_not_replaced_by_a_film(tmp_path: Path) -> None:
    recording(tmp_path / "in", moving(3))
    os.mkfifo(tmp_path / "pipe.mp4")
    with pytest.raises(UsageError, match=r"pipe\.mp4 is no file but a pipe"):
        interpolate(tmp_path / "in", tmp_path / "pipe.mp4", multiple=2, method="linear", overwrite=True)
    assert (tmp_path / "pipe.mp4").is_fifo()


def test_who_asks_twice_to_end_leaves_nothing_where_nothing_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asks_again: Callable[[], None]
) -> None:
    """The second time while it is cleared up."""

    def interrupted(*_: object) -> None:
        asks_again()
        raise KeyboardInterrupt

    source = images(tmp_path / "in", moving(2))
    monkeypatch.setattr("interp.interpolate.whole.stretches", interrupted)
    with pytest.raises(KeyboardInterrupt):
        interpolate(source, tmp_path / "out", multiple=2, method="linear", format="png")
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_file_where_a_folder_is_to_be_is_told_before_any_frame_is_made(tmp_path: Path) -> None:
    source = images(tmp_path / "in", moving(2))
    (tmp_path / "out").write_text("notes")
    for asked in ({"overwrite": True}, {"resume": True, "overwrite": True}):
        with pytest.raises(UsageError, match="out is a file"):
            interpolate(source, tmp_path / "out", **asked, report=never)
    assert (tmp_path / "out").read_text() == "notes" and len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("name", ["out", "out.mp4"])
def test_what_was_made_of_another_job_is_refused_and_nothing_is_left_beside_it(tmp_path: Path, name: str) -> None:
    source = images(tmp_path / "in", moving(2))
    interpolate(source, tmp_path / name, multiple=2, method="nearest")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(UsageError, match="begun with grid"):
        interpolate(source, tmp_path / name, multiple=3, method="nearest", resume=True, report=never)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_folder_is_called_by_its_source_and_the_multiple_whatever_dots_these_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    images(tmp_path / "v1.2", moving(2))
    made = CliRunner().invoke(command, ["v1.2", "-x", "2.5", "--format", "png", "--method", "nearest"])
    assert made.exit_code == 0, made.exception
    assert sorted(path.name for path in tmp_path.iterdir()) == ["v1.2", "v1.2_x2.5"]


def test_a_film_is_called_after_its_source_wherever_one_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    below = images(tmp_path / "clip", moving(2)) / "below"
    below.mkdir()
    monkeypatch.chdir(below)
    for source in ("..", "../below/.."):
        assert CliRunner().invoke(command, [source, "-x", "2", "--method", "nearest", "--overwrite"]).exit_code == 0
        assert {path.name for path in below.iterdir()} == {"clip_x2.mp4", "clip_x2.json"}


def test_frames_hours_apart_are_interpolated_and_a_film_of_them_plays_as_long(tmp_path: Path) -> None:
    hour_us = 3600 * 10**6
    source = images(tmp_path / "in", moving(3), step_us=hour_us)
    told = interpolate(source, tmp_path / "out", multiple=4, method="linear")
    assert told["frames"] == 9 and times_of(tmp_path / "out") == [k * hour_us // 4 for k in range(9)]
    film = interpolate(source, tmp_path / "out.mp4", multiple=4, method="linear")
    assert Fraction(film["film_rate"]) == Fraction(4, 3600)
    assert interpolate(recording(tmp_path / "r", moving(3), step_us=hour_us), tmp_path / "rec")["frames"] == 17


def exr_files(folder: Path, light: np.ndarray) -> Path:
    """A folder of pictures of light [N, H, W, 3], 40 ms apart."""
    pytest.importorskip("OpenEXR")
    from vid2ev.scenes.picture_writing import writer_of

    folder.mkdir()
    for k, each in enumerate(light):
        writer_of("exr")[0](each, folder / f"{k}.exr")
    (folder / "timestamps.txt").write_text("".join(["# us\n", *(f"{40_000 * k}\n" for k in range(len(light)))]))
    return folder


def hdr_of_frames(file: Path) -> None:
    """Weights that change any light, and need no events."""
    network = make("hdr", second="frames")
    torch.nn.init.normal_(network.out.weight, std=0.05)
    save(file, "hdr", network)


@pytest.mark.parametrize("given", [{"method": "linear"}, {"method": "flow"}, {"network": "rrin_light-tiny"}])
def test_a_lamp_of_infinite_light_is_as_bright_as_one_of_the_most_that_half_floats_hold(
    tmp_path: Path, given: dict[str, Any]
) -> None:
    made = []
    for lamp in (np.inf, 65504.0):
        light = np.stack(moving(2)).astype(np.float32) / 255
        light[:, 10:20, 10:20] = lamp
        made.append([frame.codes for frame in frames(exr_files(tmp_path / str(lamp), light), multiple=2, **given)])
    np.testing.assert_array_equal(made[0], made[1])
    assert min(float(frame[14, 14].min()) for frame in made[0]) > 50


@pytest.mark.parametrize("hdr", [False, True])
def test_light_of_key_frames_is_the_files_own_to_the_bit(tmp_path: Path, hdr: bool) -> None:
    light = np.random.default_rng(3).lognormal(-1, 3, (3, 24, 32, 3)).astype(np.float32)
    light[0, 0, 0] = -0.01, 0, 65504
    exr_files(tmp_path / "in", light)
    hdr_of_frames(tmp_path / "hdr.safetensors")
    after: dict[str, Any] = {"hdr": tmp_path / "hdr.safetensors"} if hdr else {}
    interpolate(tmp_path / "in", tmp_path / "out", multiple=2, method="linear", format="exr", cuts="keep", **after)
    written = open_source(tmp_path / "out", colour="rgb").frames()
    same = [np.array_equal(frame.light, light[k // 2]) for k, frame in enumerate(written) if k % 2 == 0]
    assert same == 3 * [not hdr]


def test_hdr_that_makes_no_numbers_is_said(tmp_path: Path) -> None:
    network = make("hdr", second="frames")
    torch.nn.init.constant_(network.out.bias, torch.nan)  # type: ignore[arg-type, union-attr]
    save(tmp_path / "broken.safetensors", "hdr", network)
    source = images(tmp_path / "in", moving(3))
    with pytest.raises(DataError, match=r"'broken' made values that are no numbers; take other weights$"):
        interpolate(source, tmp_path / "out", method="linear", hdr=tmp_path / "broken.safetensors")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", ["mp4", "png", "exr"])
def test_what_hdr_makes_above_white_is_said_to_be_in_exr_only(tmp_path: Path, kind: str) -> None:
    if kind == "exr":
        pytest.importorskip("OpenEXR")
    shown = [np.clip(1.4 * frame.astype(int), 0, 255).astype(np.uint8) for frame in moving(2)]
    source, output = recording(tmp_path / "in", shown), tmp_path / f"out{'.mp4' * (kind == 'mp4')}"
    given: dict[str, Any] = {"multiple": 1, "method": "nearest", "format": kind, "overwrite": True}
    told = [
        interpolate(source, output, hdr=hdr, **given)["remarks"] for hdr in (None, pretrained.first(pretrained.HDR))
    ]
    said = [any("above white" in remark for remark in remarks) for remarks in told]
    assert said == [False, kind != "exr"]
    if kind == "exr":
        assert max(frame.light.max() for frame in open_source(output).frames()) > 1.05


@pytest.mark.parametrize("kind", ["mp4", "png", "exr"])
@pytest.mark.parametrize(
    ("codes", "transfer", "bright"),
    [
        (np.uint8, "srgb", False), (np.uint8, "linear", False), (np.uint16, "linear", False), (np.uint8, "hlg", True),
        (np.uint16, "pq", True), (np.float32, "linear", True), (np.float32, "srgb", True),
    ],
)  # fmt: skip
def test_that_light_above_white_is_lost_is_said_where_there_may_be_some_and_it_is(
    tmp_path: Path, kind: str, codes: type[np.generic], transfer: str, bright: bool
) -> None:
    if kind == "exr":
        pytest.importorskip("OpenEXR")
    top = 255 if codes is np.uint8 else 65535 if codes is np.uint16 else 2
    shown = np.stack([top * (frame / 255) for frame in moving(2)]).astype(codes)
    shown[:, :8] = top
    np.savez(tmp_path / "in.npz", frames=shown, t_us=np.array([0, 40_000]))
    output = tmp_path / f"out{'.mp4' * (kind == 'mp4')}"
    told = interpolate(tmp_path / "in.npz", output, multiple=1, format=kind, options=Options(transfer=transfer))  # type: ignore[arg-type]
    assert any("above white" in remark for remark in told["remarks"]) == (bright and kind != "exr")
    if kind == "exr":
        assert (max(frame.light.max() for frame in open_source(output).frames()) > 1) == bright


def test_hdr_makes_no_light_above_white_darker(tmp_path: Path) -> None:
    light = np.stack([frame.astype(np.float32) / 255 for frame in moving(3)])
    light[:, 10:20, 10:20], light[1:, 30:40, 10:20] = 30, 3
    exr_files(tmp_path / "in", light)
    hdr_of_frames(tmp_path / "hdr.safetensors")
    given: dict[str, Any] = {"multiple": 2, "method": "linear"}
    made, plain = (
        np.stack([frame.codes for frame in frames(tmp_path / "in", **given, hdr=hdr)])
        for hdr in (tmp_path / "hdr.safetensors", None)
    )
    above = plain > 1
    assert above[:, 15, 15].all() and (made[above] >= plain[above] * (1 - 1e-5)).all()
    assert not np.allclose(made[~above], plain[~above], atol=1e-3)


@pytest.mark.parametrize("part", [(None, None), (None, 0.22), (0.07, None), (0.03, 0.13), (None, 0.01)])
def test_a_film_of_a_part_plays_in_real_time_wherever_that_begins_and_ends(
    tmp_path: Path, part: tuple[float | None, float | None]
) -> None:
    source = images(tmp_path / "in", moving(6), step_us=50_000)
    options = Options(start_s=part[0], stop_s=part[1], crop="64x32+0+0")
    told = interpolate(source, tmp_path / "a.mp4", multiple=2, method="linear", options=options)
    assert Fraction(told["film_rate"]) == 2 * 20


@pytest.mark.parametrize(
    "asked",
    [{"multiple": "2.718281828459"}, {"multiple": "1e-400"}, {"fps": "959.123456789"}, {"fps": "1e-9"},
     {"play": "29.97002997002997"}, {"play": "1e-400"}],
)  # fmt: skip
def test_a_film_of_any_rate_is_written_at_the_nearest_that_films_have(tmp_path: Path, asked: dict[str, str]) -> None:
    source = images(tmp_path / "in", moving(2), step_us=40_000)
    told = interpolate(source, tmp_path / "a.mp4", method="linear", **asked)
    (key, number), rate = *asked.items(), Fraction(told["film_rate"])
    meant = max(Fraction(number) * (25 if key == "multiple" else 1), SLOWEST_HZ)
    assert abs(rate - meant) <= meant * 1e-6
    assert len(list(open_source(tmp_path / "a.mp4").frames())) == told["frames"]


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("tile", 3, "tile '3': expected none, auto"),
        ("hdr", True, "weights True: no such file"),
        ("network", 3, "weights 3: no such file"),
        ("method", 3, "method '3': expected one of"),
        ("options", None, "options None: expected Options"),
    ],
)
def test_arguments_that_are_none_are_refused_in_a_sentence(
    tmp_path: Path, name: str, value: Any, sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence) as refused:
        interpolate(images(tmp_path / "in", moving(2)), tmp_path / "out", **{name: value})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("grey", range(3))
def test_a_grey_picture_among_coloured_ones_takes_no_colours(tmp_path: Path, grey: int) -> None:
    shown = [frame[..., 0].copy() if k == grey else frame for k, frame in enumerate(moving(3))]
    source = images(tmp_path / "in", shown)
    (source / "._000000.png").write_bytes(b"what a Mac leaves beside")
    interpolate(source, tmp_path / "out", multiple=2, method="linear")
    for frame, found in zip(shown, made(tmp_path / "out")[::2], strict=True):
        np.testing.assert_array_equal(found, frame if frame.ndim == 3 else np.repeat(frame[..., None], 3, axis=2))


def test_grey_pictures_are_not_read_to_know_that_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, read = images(tmp_path / "in", [frame[..., 0].copy() for frame in moving(5)]), cv2.imread
    asked: list[str] = []
    monkeypatch.setattr(cv2, "imread", lambda path, *rest: asked.append(path) or read(path, *rest))
    assert open_take(folder, Options()).channels == 1
    assert {Path(path).name for path in asked} == {"000000.png"}


def test_the_command_says_what_it_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    images(tmp_path / "a", moving(3))
    result = CliRunner().invoke(command, ["a", "-x", "2", "--method", "linear"])
    assert result.exit_code == 0, result.output
    assert "a_x2.mp4: 5 frames of 64x48 as mp4" in result.output
    again = CliRunner().invoke(command, ["a", "-x", "2", "--method", "linear", "--resume", "--json"])
    assert json.loads(again.output)["frames"] == 5
    write_codes(tmp_path / "a" / "000001.png", moving(3)[0])
    other = CliRunner().invoke(command, ["a", "-x", "3", "--method", "linear", "-o", "a_x2.mp4", "--resume"])
    assert isinstance(other.exception, UsageError) and "--overwrite starts again" in str(other.exception)


def test_frames_come_one_by_one_as_they_are_written(tmp_path: Path) -> None:
    source = recording(tmp_path / "in", moving(4))
    interpolate(source, tmp_path / "out", multiple="2.5")
    coming = frames(source, multiple="2.5")
    written = sorted((tmp_path / "out").glob("*.png"))
    for path, frame, t_us in zip(written, coming, times_of(tmp_path / "out"), strict=True):
        codes = np.rint(np.clip(frame.codes, 0, 1) * np.float32(255)).astype(np.uint8)
        np.testing.assert_array_equal(codes, read_codes(path))
        assert frame.instant.t_us == t_us
    with pytest.raises(UsageError, match="needs events"):
        frames(images(tmp_path / "a", moving(2)), method="bridge")


def test_hdr_stands_anywhere_among_the_arguments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    recording(tmp_path / "b", moving(2))
    result = CliRunner().invoke(command, ["--hdr", "b", "-x", "2", "--method", "bridge", "--json"])
    assert result.exit_code == 0, result.output
    weights = Path(json.loads(result.output)["hdr"]["weights"]).stem
    assert weights in pretrained.HDR
    said = CliRunner().invoke(command, ["--hdr", "b", "-x", "2", "--method", "bridge", "--overwrite"]).output
    assert re.search(rf"^hdr +all frames, by {weights}$", said, re.MULTILINE)
    without = CliRunner().invoke(command, ["b", "-x", "2", "--method", "bridge", "--overwrite"]).output
    assert not re.search("^hdr ", without, re.MULTILINE)


def test_grey_frames_move_as_those_of_one_colour_do(tmp_path: Path) -> None:
    grey = [frame[..., 0] for frame in moving(2)]
    coloured = [np.repeat(frame[..., None], 3, 2) for frame in grey]
    for name, pictures in (("grey", grey), ("coloured", coloured)):
        interpolate(images(tmp_path / name, pictures), tmp_path / f"out_{name}", multiple=3, method="flow")
    for k in range(4):
        one, other = (read_codes(tmp_path / f"out_{name}" / f"{k:06d}.png") for name in ("grey", "coloured"))
        assert one.ndim == 2
        np.testing.assert_allclose(one, other[..., 0], atol=1)


@pytest.mark.parametrize("grey", [False, True])
def test_a_network_of_one_colour_takes_frames_as_they_are(tmp_path: Path, grey: bool) -> None:
    network = make("rrin", colours=1, zero_heads=False)
    save(tmp_path / "one.safetensors", "rrin", network)
    pictures = [frame[..., 1] if grey else frame for frame in moving(2)]
    found = [*frames(images(tmp_path / "in", pictures), multiple=2, network=tmp_path / "one.safetensors")]
    keys = [torch.from_numpy(each.codes).movedim(-1, 0)[None] for each in found]
    with torch.inference_mode():
        wanted = network.eval()(keys[0], keys[2], [0.5]).images[0, 0]
    assert found[1].codes.shape == (SIZE[1], SIZE[0], 1 if grey else 3)
    torch.testing.assert_close(keys[1][0], wanted, rtol=0, atol=1e-5)
    interpolate(tmp_path / "in", tmp_path / "out", multiple=2, network=tmp_path / "one.safetensors")
    assert made(tmp_path / "out")[1].ndim == (2 if grey else 3)


@pytest.mark.parametrize("second", ["events", "frames"])
def test_hdr_of_one_colour_processes_each_plane_as_a_grey_frame(tmp_path: Path, second: str) -> None:
    network = make("hdr", colours=1, second=second)
    torch.nn.init.normal_(network.out.weight, std=0.05)  # type: ignore[arg-type, union-attr]
    save(tmp_path / "one.safetensors", "hdr", network)
    pictures = [np.clip(1.4 * frame.astype(float), 0, 255).astype(np.uint8) for frame in moving(3)]
    assert 0.1 < np.mean([frame == 255 for frame in pictures]) < 0.9
    planes = [[np.repeat(frame[..., k : k + 1], 3, 2) for frame in pictures] for k in range(3)]
    given: dict[str, Any] = {"multiple": 2, "method": "linear", "hdr": tmp_path / "one.safetensors"}
    known = Options(contrast=(0.2, 0.2))
    found, *of_planes = (
        [*frames(recording(tmp_path / f"{k}", shown), options=known, **given)]
        for k, shown in enumerate([pictures, *planes])
    )
    for number, frame in enumerate(found):
        assert np.abs(frame.codes - pictures[number // 2] / 255).max() > 0.02
        for k, of_plane in enumerate(of_planes):
            np.testing.assert_allclose(frame.codes[..., k], of_plane[number].codes[..., 0], atol=1e-5)


def test_hdr_that_sees_frames_takes_grey_ones_as_colours_that_are_alike(tmp_path: Path) -> None:
    network = make("hdr", second="frames")
    torch.nn.init.normal_(network.out.weight, std=0.05)  # type: ignore[arg-type, union-attr]
    save(tmp_path / "hdr.safetensors", "hdr", network)
    grey = [frame[..., 0] for frame in moving(2)]
    alike = [np.repeat(frame[..., None], 3, 2) for frame in grey]
    found, wanted = (
        [*frames(images(tmp_path / name, shown), multiple=2, method="linear", hdr=tmp_path / "hdr.safetensors")]
        for name, shown in (("grey", grey), ("alike", alike))
    )
    for one, other in zip(found, wanted, strict=True):
        assert one.codes.shape[2] == 1
        np.testing.assert_allclose(one.codes[..., 0], other.codes.mean(2), atol=1e-5)


def test_images_without_times_are_told_the_option_that_gives_them(tmp_path: Path) -> None:
    folder = images(tmp_path / "in", moving(2))
    (folder / "timestamps.txt").unlink()
    with pytest.raises(UsageError, match="give --source-fps, or"):
        interpolate(folder, tmp_path / "out", method="linear")
    with pytest.raises(UsageError, match=r"^--source-fps 0: expected a number of frames per second"):
        interpolate(folder, tmp_path / "out", method="linear", options=Options(source_hz=Fraction(0)))
    options = Options(source_hz=Fraction(25))
    assert interpolate(folder, tmp_path / "out", method="linear", multiple=2, options=options)["frames"] == 3
