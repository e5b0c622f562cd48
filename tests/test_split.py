"""A clip split by tiles or at cuts: the recording put together has the bytes of one made at once."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev import DataError, UsageError, convert
from vid2ev.cluster.task import Task
from vid2ev.commands import main
from vid2ev.formats import read_events
from vid2ev.making import stretches
from vid2ev.making.conversion import Paused
from vid2ev.making.split import check_split, convert_split
from vid2ev.making.stretches import at_cuts, warm_up_us, with_warm_up
from vid2ev.recording.held import Held
from vid2ev.rig.camera import Camera, Rig
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.tracks import parts
from vid2ev.tracks.parts import Replayed

pytestmark = pytest.mark.long

PROBED = ("90,60", "3,4", "50,10")
FILES = ("events.h5", "preview.mp4", "noise_maps.npz")


def here(tasks: Sequence[Task]) -> None:
    """All tasks in this process, the last first."""
    for task in reversed(tasks):
        task.call(lambda _: None)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> str:
    """96x64 pixels, which are three blocks; some move, some rest, some are not finite, and there are two cuts."""
    rng = np.random.default_rng(0)
    textures = [cv2.GaussianBlur(np.exp(rng.normal(0, 0.5, (64, 140))), (0, 0), 1.5) ** 4 for _ in range(3)]
    frames = np.stack([textures[k // 5][:, 2 * k : 2 * k + 96] for k in range(14)])
    frames[:, :20] = 0.5
    frames[1, 40, 5] = np.nan
    path = tmp_path_factory.mktemp("split") / "clip.npy"
    np.save(path, frames.astype(np.float32))
    return str(path)


@pytest.mark.parametrize("kind", ["tiles", "cuts"])
@pytest.mark.parametrize(
    "options",
    [
        {"sensor": "paper", "upsample": "flow", "subframes": 3},
        {"sensor": "v2e-noisy", "upsample": "none", "labels": True, "formats": "hdf5,csv", "slowdown": 1.7},
        {"overrides": ("delay_us=700", "max_crossings=3"), "upsample": "linear", "subframes": 2, "probe": PROBED},
    ],
    ids=str,
)
def test_parts_together_have_the_bytes_of_the_whole(
    clip: str, tmp_path: Path, kind: str, options: dict[str, Any]
) -> None:
    options = {"fps": 50, "noise_maps": True, "threads": 1} | options
    whole = convert(clip, tmp_path / "whole", **options)
    assert len(whole["cuts_us"]) == 2
    made = convert_split(clip, tmp_path / "made", kind, 3, here, **options)
    assert whole.pop("run") and made.pop("run") and made == whole and whole["counts"]["events"] > 10_000
    for name in (*FILES, *["events.csv"] * ("formats" in options), *["probe.csv", "probe.png"] * ("probe" in options)):
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert {path.name for path in tmp_path.iterdir()} == {"whole", "made"}
    again = convert_split(clip, tmp_path / "made", kind, 3, here, resume=True, **options)
    again.pop("run")
    assert again == whole


@pytest.mark.parametrize("block", [1, 2, parts.BLOCK])
def test_what_was_sent_at_the_instant_of_a_frame_comes_with_that_frame(
    tmp_path: Path, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames have the events of (t0, t1], of all parts in the order of the pixels; and so has who goes on between,
    however many events are read at a time."""
    monkeypatch.setattr(parts, "BLOCK", block)
    texts = ["t,x,y,p\n10,0,0,1\n20,3,0,1\n20,3,1,0\n21,0,0,1\n", "t,x,y,p\n20,5,0,1\n30,5,0,0\n"]
    files = [tmp_path / "0.csv", tmp_path / "1.csv"]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text)
    mount: Any = SimpleNamespace(size=(8, 2), within="", sensor=SimpleNamespace(spec=DvsSpec()))
    frames = [Frame(np.empty((2, 8)), t_us * 1000) for t_us in (10, 20, 25, 30)]
    first, second = Replayed(mount, files, False), Replayed(mount, files, False)
    sent = [(events.t.tolist(), events.x.tolist()) for events in first.see_all(frames[:2])]
    second.restore(first.state())
    sent += [(events.t.tolist(), events.x.tolist()) for events in second.see_all(frames[2:])]
    assert sent == [([10], [0]), ([20, 20, 20], [3, 5, 3]), ([21], [0]), ([30], [5])]


def test_of_a_part_that_has_fewer_events_than_were_sent_nobody_waits_for_more(tmp_path: Path) -> None:
    (tmp_path / "0.csv").write_text("t,x,y,p\n10,0,0,1\n")
    mount: Any = SimpleNamespace(size=(8, 2), within="", sensor=SimpleNamespace(spec=DvsSpec()))
    replayed = Replayed(mount, [tmp_path / "0.csv"], False)
    replayed.restore({"sent": np.array([1], np.int64)})
    with pytest.raises(UsageError, match="state of 2 events sent of a part that has 1"):
        replayed.restore({"sent": np.array([2], np.int64)})


def test_who_goes_on_keeps_to_the_clock_of_the_readout(tmp_path: Path) -> None:
    part = tmp_path / "0.csv"
    part.write_text("t,x,y,p\n27,0,0,1\n47,3,0,1\n67,3,1,0\n87,0,0,1\n")
    spec = DvsSpec(frame_rate_hz=50_000, rounding="causal")
    mount: Any = SimpleNamespace(size=(8, 2), within="", sensor=SimpleNamespace(spec=spec))
    frames = [Frame(np.empty((2, 8)), t_us * 1000) for t_us in (7, 30, 55, 90)]
    whole, first, second = (Replayed(mount, [part], False) for _ in range(3))
    for sensor in (whole, first):
        sensor.see(frames[0])
    sent = [events.t.tolist() for events in whole.see_all(frames[1:])]
    begun = [events.t.tolist() for events in first.see_all(frames[1:2])]
    second.restore(first.state())
    assert begun + [events.t.tolist() for events in second.see_all(frames[2:])] == sent
    assert all(sent[1:])


@pytest.mark.parametrize("rounding", ["nearest", "causal"])
@pytest.mark.parametrize("light", [{"upsample": "none"}, {"upsample": "linear", "subframes": 5}], ids=str)
def test_tiles_keep_to_the_clock_of_the_readout(
    clip: str, tmp_path: Path, rounding: str, light: dict[str, Any]
) -> None:
    """In the preview, too, where events of an event frame that is nearest are shown when it is complete."""
    overrides = ("frame_rate_hz=130", f"rounding={rounding}")
    options: dict[str, Any] = {"fps": 20, "threads": 1, "overrides": overrides} | light
    convert(clip, tmp_path / "whole", **options)
    convert_split(clip, tmp_path / "made", "tiles", 2, here, **options)
    for name in FILES[:2]:
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


@pytest.mark.parametrize("kind", ["tiles", "cuts"])
def test_what_is_interrupted_anywhere_goes_on_to_the_same_bytes(clip: str, tmp_path: Path, kind: str) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "piece": 1}
    convert(clip, tmp_path / "whole", **options)

    def only_one(tasks: Sequence[Task]) -> None:
        tasks[1].call(lambda _: None)
        raise KeyboardInterrupt

    def interrupted(_: Any, done: Any) -> None:
        if done.frames == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", kind, 2, only_one, **options)
    assert not (tmp_path / "made").exists()
    with pytest.raises(UsageError, match="--resume continues it"):
        convert_split(clip, tmp_path / "made", kind, 2, here, **options)
    with pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", kind, 2, here, resume=True, report=interrupted, **options)
    convert_split(clip, tmp_path / "made", kind, 2, here, resume=True, **options)
    for name in FILES[:2]:
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert {path.name for path in tmp_path.iterdir()} == {"whole", "made"}


def test_of_parts_whose_workers_ended_before_a_checkpoint_nothing_is_left(clip: str, tmp_path: Path) -> None:
    """Of others what can be gone on with, and what somebody is still making."""
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1}
    parts = [tmp_path / "made.parts" / f"{number}-of-4.partial" for number in range(4)]

    def begun(tasks: Sequence[Task]) -> None:
        for part in parts[: len(tasks)]:
            part.mkdir()
            (part / "job.json").write_text("{}")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", "tiles", 2, begun, **options)
    assert not [*tmp_path.iterdir()]

    def left(_: Sequence[Task]) -> None:
        (parts[1] / "checkpoint.npz").touch()
        begun([])

    for part in parts[:3]:
        part.mkdir(parents=True)
    with Held(parts[2]), pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", "tiles", 4, left, resume=True, **options)
    assert [path for path in sorted(parts[0].parent.iterdir()) if path.is_dir()] == parts[1:3]


@pytest.mark.parametrize("kind", ["tiles", "approximate"])
def test_a_seed_that_is_drawn_is_that_of_all_parts_and_of_those_made_later(
    clip: str, tmp_path: Path, kind: str
) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "preview": False}

    def only_one(tasks: Sequence[Task]) -> None:
        tasks[0].call(lambda _: None)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", kind, 2, only_one, seed=None, **options)
    seed = json.loads((tmp_path / "made.parts/0-of-2/manifest.json").read_text())["seed"]
    made = convert_split(clip, tmp_path / "made", kind, 2, here, resume=True, seed=None, **options)
    assert made["seed"] == seed
    convert_split(clip, tmp_path / "again", kind, 2, here, seed=seed, **options)
    assert (tmp_path / "made/events.h5").read_bytes() == (tmp_path / "again/events.h5").read_bytes()


@pytest.mark.parametrize("damage", ["cut", "gone", "no manifest"])
def test_a_part_that_is_damaged_is_made_again_once_it_is_removed(clip: str, tmp_path: Path, damage: str) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "preview": False, "resume": True}
    part = tmp_path / "made.parts" / "1-of-2"

    def damaged(tasks: Sequence[Task]) -> None:
        here(tasks)
        if damage == "no manifest":
            (part / "manifest.json").write_text("")
            here(tasks)
        elif damage == "gone":
            (part / "events.h5").unlink()
        else:
            os.truncate(part / "events.h5", (part / "events.h5").stat().st_size // 2)

    with pytest.raises(DataError, match=r"1-of-2, a part that was made, is damaged .*; remove it and --resume$"):
        convert_split(clip, tmp_path / "made", "tiles", 2, damaged, **options)
    shutil.rmtree(part)
    convert_split(clip, tmp_path / "made", "tiles", 2, here, **options)
    convert(clip, tmp_path / "whole", **options)
    assert (tmp_path / "made/events.h5").read_bytes() == (tmp_path / "whole/events.h5").read_bytes()


@pytest.mark.parametrize("name", ["thesis.txt", "0-of-2", "notes/thesis.txt"])
@pytest.mark.parametrize("how", ["overwrite", "resume"])
def test_what_is_no_part_is_never_removed(clip: str, tmp_path: Path, name: str, how: str) -> None:
    theirs = tmp_path / "made.parts" / name
    theirs.parent.mkdir(parents=True)
    theirs.write_text("of somebody else")
    with pytest.raises(UsageError, match=r"made\.parts is needed to work in, and holds .*, which is no part"):
        convert_split(clip, tmp_path / "made", "tiles", 2, here, fps=50, **{how: True})
    assert theirs.read_text() == "of somebody else"
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [theirs]


def test_parts_that_another_process_makes_are_left_to_it(clip: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "preview": False}

    def meanwhile(tasks: Sequence[Task]) -> None:
        tasks[0].call(lambda _: None)
        for how in ({"overwrite": True}, {"resume": True}):
            with pytest.raises(UsageError, match=r"another vid2ev is writing .*made\.parts; wait for it"):
                convert_split(clip, tmp_path / "made", "tiles", 2, here, **how, **options)
        assert (tmp_path / "made.parts" / "0-of-2" / "manifest.json").exists()
        here(tasks)

    convert_split(clip, tmp_path / "made", "tiles", 2, meanwhile, **options)
    assert {path.name for path in tmp_path.iterdir()} == {"made"}


def test_starting_again_removes_the_parts_that_were_begun(clip: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "preview": False}
    begun = [tmp_path / "made.parts" / name for name in ("0-of-7", "1-of-7.partial")]
    for part in begun:
        part.mkdir(parents=True)

    def look(tasks: Sequence[Task]) -> None:
        assert not any(part.exists() for part in begun)
        here(tasks)

    with Held(begun[1]), pytest.raises(UsageError, match="another vid2ev is writing"):  # (by a worker left over)
        convert_split(clip, tmp_path / "made", "tiles", 2, look, overwrite=True, **options)
    convert_split(clip, tmp_path / "made", "tiles", 2, look, overwrite=True, **options)
    assert {path.name for path in tmp_path.iterdir()} == {"made"}


@pytest.mark.parametrize("begun", ["parts", "whole"])
def test_with_other_options_it_begins_again_where_it_may(clip: str, tmp_path: Path, begun: str) -> None:
    """As what is not split does, with both --resume and --overwrite; with --resume alone it is refused."""
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "preview": False}

    def only_one(tasks: Sequence[Task]) -> None:
        tasks[0].call(lambda _: None)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) if begun == "parts" else nullcontext():
        convert_split(clip, tmp_path / "made", "tiles", 2, only_one if begun == "parts" else here, **options)
    with pytest.raises(UsageError, match="seed = 0, not 1"):
        convert_split(clip, tmp_path / "made", "tiles", 2, here, resume=True, seed=1, **options)
    seen: list[int] = []
    again: dict[str, Any] = {"resume": True, "overwrite": True, "report": lambda _, done: seen.append(done.frames)}
    made = convert_split(clip, tmp_path / "made", "tiles", 2, here, seed=1, **again, **options)
    assert made["seed"] == 1 and seen and {path.name for path in tmp_path.iterdir()} == {"made"}
    convert(clip, tmp_path / "whole", seed=1, **options)
    assert (tmp_path / "made/events.h5").read_bytes() == (tmp_path / "whole/events.h5").read_bytes()


@pytest.mark.parametrize("kind", ["tiles", "cuts"])
def test_the_cameras_of_a_rig_are_split_alike(clip: str, tmp_path: Path, kind: str) -> None:
    rig = tmp_path / "rig.toml"
    cameras = ["left", "dvs"], ["still", "cis"], ["right", "dvs"]
    lines = [f'[[camera]]\nname = "{name}"\nkind = "{sort}"\n' for name, sort in cameras]
    rig.write_text("".join(lines) + "size = [48, 32]\n")
    options: dict[str, Any] = {
        "fps": 50,
        "upsample": "linear",
        "subframes": 3,
        "threads": 1,
        "rig": rig,
        "preview": False,
        "truth": "mask,poses",
    }
    convert(clip, tmp_path / "whole", **options)
    convert_split(clip, tmp_path / "made", kind, 2, here, **options)
    for name in ("left/events.h5", "right/events.h5", "still/raw/000000.png", "left/truth/poses.txt"):
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


@pytest.mark.parametrize("kind", ["tiles", "approximate"])
def test_parts_hold_the_events_alone_which_may_be_seen_at_the_instants_of_frame_cameras(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stretches, "WARM_US", 10_000)
    scene = "scene:spinning-shapes,duration_s=0.06,size=64x48,max_shift_px=2"
    still = Camera(name="still", kind="cis", size=(96, 72), translation_mm=(30, 0, 0), set={"frame_rate_hz": 100})
    rig = Rig(cameras=(still, Camera(name="left", kind="dvs"), Camera(name="right", kind="dvs", clock_offset_us=7)))
    options: dict[str, Any] = {"threads": 1, "rig": rig, "preview": False, "truth": "depth,map", "sensor": "ideal"}
    held = set()

    def looked_at(tasks: Sequence[Task]) -> None:
        here(tasks)
        held.update(path.relative_to(tmp_path / "made.parts").parts[1:2] for path in tmp_path.glob("made.parts/*/*"))

    whole = convert(scene, tmp_path / "whole", **options)
    convert_split(scene, tmp_path / "made", kind, 2, looked_at, **options)
    assert held == {("left",), ("right",), ("manifest.json",), ("rig.toml",)}
    for name in ("left/events.h5", "right/events.h5") * (kind == "tiles") + ("still/raw/000003.png",):
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    made = json.loads((tmp_path / "made/manifest.json").read_text())
    assert [each["counts"]["frames"] for each in made["results"].values()] == [
        each["counts"]["frames"] for each in whole["results"].values()
    ]


@pytest.mark.parametrize(
    ("kind", "options", "sentence"),
    [
        ("tiles", {"effects": "auto"}, "cannot do --effects auto; name those"),
        ("tiles", {"device": "cuda"}, "cannot do --device cuda"),
        ("approximate", {"probe": ["3,4"]}, "cannot do --probe; take --split cuts"),
        ("cuts", {"overrides": ["frame_rate_hz=1000"]}, "cannot do frame_rate_hz; take --split tiles"),
        ("cuts", {"cuts": "keep"}, "cannot do --cuts keep"),
    ],
    ids=str,
)
def test_what_cannot_be_split_is_refused(
    clip: str, tmp_path: Path, kind: str, options: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence):
        convert_split(clip, tmp_path / "made", kind, 2, here, fps=50, **options)
    with pytest.raises(UsageError, match=sentence):  # (and what is only to be checked)
        check_split(clip, tmp_path / "made", kind, overwrite=False, resume=False, fps=50, **options)
    assert not list(tmp_path.iterdir())


def test_what_has_no_events_or_passes_once_is_not_split(
    clip: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rig.toml").write_text('[[camera]]\nname = "still"\nkind = "cis"\n')
    film = b"YUV4MPEG2 W4 H4 F50:1 Cmono\n" + 3 * (b"FRAME\n" + bytes(16))
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=BytesIO(film), isatty=lambda: False))
    for video, options, sentence in (
        (clip, {"rig": tmp_path / "rig.toml"}, "cannot do a rig without event cameras; convert it at once"),
        ("-", {}, "cannot do -; keep it in a file first"),
    ):
        with pytest.raises(UsageError, match=sentence):
            convert_split(video, tmp_path / "made", "tiles", 2, here, fps=50, **options)
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]


def test_parts_with_a_warm_up_differ_from_their_seam_to_the_next_cut_and_the_manifest_lists_seams(
    clip: str, tmp_path: Path
) -> None:
    options: dict[str, Any] = {"fps": 1, "upsample": "linear", "subframes": 2, "threads": 1, "preview": False}
    whole = convert(clip, tmp_path / "whole", **options)
    made = convert_split(clip, tmp_path / "made", "approximate", 3, here, **options)
    assert made["split"] == {"kind": "approximate", "seams_us": [4_000_000, 8_000_000], "warm_up_us": 1_004_100}
    for name in ("frames", "subframes", "not_finite"):
        assert made["counts"][name] == whole["counts"][name]
    one, other = (Events.concatenate(read_events(tmp_path / name)) for name in ("whole", "made"))
    assert made["counts"]["events"] == len(other) == made["counts"]["on"] + made["counts"]["off"]
    assert np.all(np.diff(other.t) >= 0) and len(other) == pytest.approx(len(one), rel=0.02)
    # (There are cuts at 5 and 10 s.)
    for first_s, last_s, exact in ((0, 4, True), (5, 8, True), (8, 10, False), (10, 14, True)):
        parts = [each.select((each.t > 10**6 * first_s) & (each.t <= 10**6 * last_s)) for each in (one, other)]
        assert len(parts[0]) > 1000
        assert exact == all(np.array_equal(getattr(parts[0], name), getattr(parts[1], name)) for name in "txyp")


@pytest.mark.parametrize(
    ("overrides", "beyond_us"),
    [
        ((), 0),
        (("refractory_us=700", "delay_us=50"), 750),
        (("photoreceptor_tau_us=300", "follower_tau_us=20"), 3200),
        (("photoreceptor_tau_us=300", "follower_tau_us=20", "bandwidth=light", "bandwidth_dark=0.1"), 33_200),
    ],
    ids=str,
)
@pytest.mark.parametrize("slowdown", [1.0, 2.5])
def test_a_part_is_shown_what_is_before_it_for_its_warm_up_and_up_to_a_frame_more(
    tmp_path: Path, overrides: tuple[str, ...], beyond_us: int, slowdown: float
) -> None:
    """1 s, 10 time constants of all poles in the dark, the refractory period and the delay."""
    np.save(tmp_path / "clip.npy", np.ones((50, 4, 4), np.float32))
    recipe = Recipe.of(tmp_path / "clip.npy", "ideal", overrides=overrides, fps=10.0, slowdown=slowdown)
    frame_ns = round(10**8 / slowdown)
    assert warm_up_us(recipe) == 10**6 + beyond_us
    first, *later = with_warm_up(recipe, 4, {"slowdown": slowdown})
    assert len(later) == 3 and (first.start, first.since_ns, later[-1].stop) == (None, None, None)
    for before, stretch in pairwise([first, *later]):
        shown = [k * frame_ns for k in range(50) if stretch.start is None or k > 10 * stretch.start]
        assert 1000 * warm_up_us(recipe) <= stretch.since_ns - shown[0] <= 1000 * warm_up_us(recipe) + frame_ns or (
            stretch.start is None
        )
        last = max(k for k in range(50) if k < 10 * before.stop)
        assert stretch.since_ns == last * frame_ns  # (the last frame of one is the first of the next)
    assert [round(stretch.since_ns / frame_ns) for stretch in later] == [12, 24, 36]


@pytest.mark.parametrize("slowdown", [1.0, 2.5])
@pytest.mark.parametrize(
    ("shots", "count", "begin"),
    [
        ([10, 21, 33], 4, [10, 21, 33]),
        ([10, 21, 33], 2, [21]),
        ([2, 4, 12], 3, [12]),
        ([2, 4, 37], 3, [4, 37]),
        ([19, 23], 8, [19, 23]),
        ([], 5, []),
    ],
)
def test_parts_begin_with_the_shots_that_are_nearest_to_even_parts(
    tmp_path: Path, shots: list[int], count: int, begin: list[int], slowdown: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 40 frames; each part ends with the frame before the next one begins."""
    np.save(tmp_path / "clip.npy", np.arange(40, dtype=np.float32)[:, None, None] * np.ones((1, 4, 4), np.float32))
    monkeypatch.setattr(stretches.CutDetector, "begins_shot", lambda _, a, b: int(b.light[0, 0]) in shots)
    recipe = Recipe.of(tmp_path / "clip.npy", "ideal", fps=10.0, slowdown=slowdown)
    parts = at_cuts(recipe, count, {"slowdown": slowdown})
    assert [part.start and math.ceil(10 * part.start) for part in parts] == [None, *begin]
    assert [part.stop and math.floor(10 * part.stop) for part in parts] == [*(first - 1 for first in begin), None]
    assert all(part.since_ns is None for part in parts)


def test_of_few_frames_there_are_few_parts(tmp_path: Path) -> None:
    np.save(tmp_path / "clip.npy", np.ones((3, 4, 4), np.float32))
    parts = with_warm_up(Recipe.of(tmp_path / "clip.npy", "ideal", fps=10.0), 5, {})
    assert [part.since_ns for part in parts] == [None, 10**8]


def test_a_chain_is_gone_on_with_from_every_checkpoint(clip: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "piece": 1}
    convert(clip, tmp_path / "whole", **options)
    links = 0
    while not (tmp_path / "made").exists():
        links += 1
        with suppress(Paused):
            convert(clip, tmp_path / "made", resume=True, pause=lambda: True, **options)
    assert links > 10
    for name in FILES[:2]:
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--split", "tiles"], "add --jobs 2 or more, or --scheduler"),
        (["--split", "tiles:2", "--jobs", "1"], "add --jobs 2 or more, or --scheduler"),
        (["--split", "time"], "expected one of tiles"),
    ],
)
def test_a_split_that_cannot_be_is_refused(options: list[str], sentence: str) -> None:
    result = CliRunner().invoke(main, ["convert", "synthetic:moving-edge", *options])
    assert result.exit_code == 2 and sentence in result.stderr


@pytest.mark.parametrize(("where", "kept"), [("_parts", False), ("convert", True)])
def test_who_interrupts_the_command_is_told_what_is_kept(
    clip: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, kept: bool
) -> None:
    """While it looks for cuts, and while the parts are put together."""

    def asked(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    def alone(tasks: Sequence[Task], *_: Any) -> list[SimpleNamespace]:
        for folder in (Path("made.parts") / f"{number}-of-{len(tasks)}" for number in range(len(tasks))):
            folder.mkdir()
        return []

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(f"vid2ev.making.split.{where}", asked)
    monkeypatch.setattr("vid2ev.commands.live.shared_out", alone)
    result = CliRunner().invoke(main, ["convert", clip, "--fps", "50", "-o", "made", "--jobs", "2", "--split", "tiles"])
    assert (result.exit_code, "--resume" in result.stderr, "nothing is left" in result.stderr) == (130, kept, not kept)
    assert Path("made.parts").exists() == kept


def test_who_interrupts_once_the_recording_is_there_is_told_that_it_is_kept(
    clip: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: str, directory: Path, *__: Any, **___: Any) -> None:
        directory.mkdir()
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("vid2ev.making.split.convert_split", interrupted)
    result = CliRunner().invoke(main, ["convert", clip, "--fps", "50", "-o", "made", "--jobs", "2", "--split", "tiles"])
    assert result.exit_code == 130 and "--resume goes on" in result.stderr


@pytest.mark.slow
def test_the_command_splits_among_its_workers(clip: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = [clip, "--fps", "50", "--upsample", "none", "--no-preview"]
    assert CliRunner().invoke(main, ["convert", *options, "-o", "whole"]).exit_code == 0
    for split in ("tiles", "cuts:2", "chain:0.0001"):
        result = CliRunner().invoke(main, ["convert", *options, "-o", split, "--jobs", "2", "--split", split, "--json"])
        assert result.exit_code == 0 and json.loads(result.stdout)[0]["events"] > 0
        assert Path(split, "events.h5").read_bytes() == Path("whole/events.h5").read_bytes()
