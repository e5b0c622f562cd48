"""`convert` on a device makes the recording that it makes on the CPU.

Light is in tensors of torch, on the CPU.  In most tests the sensor is that of a CPU, too, but is given frames as a card
is, many at a time; two slow ones make all with a card that is simulated, whose kernels take half a minute to compile.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import pytest
import torch
from click.testing import CliRunner

from vid2ev import Events, UsageError, convert, read_events
from vid2ev.commands import main
from vid2ev.plan import planner
from vid2ev.rig.camera import Camera, Rig, Source
from vid2ev.sensors import devices
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.devices import UNKNOWN_FRAMES, Work, device_for
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.dvs_on_card import FRAMES
from vid2ev.stream.exposures import Exposure
from vid2ev.stream.frames import Frame
from vid2ev.stream.upload import downloaded

pytestmark = pytest.mark.long

CLIP = "synthetic:moving-edge,size=64x48,fps=100,duration_s=0.3"
NOISY = ["shot_rate_hz=20", "leak_rate_hz=1", "hot_probability=0.01", "hot_rate_hz=200"]
OPTIONS: dict[str, Any] = {"upsample": "linear", "subframes": 3, "seed": 5, "labels": True, "threads": 1}
PLAIN = {"overrides": ["random_phase=true", "mismatch=0", "crossing_noise=0", "refractory_us=0"]}


class Gathering(Dvs):
    """A sensor of a CPU that takes as many frames at a time as one on a card."""

    given: ClassVar[list[int]] = []

    def __init__(self, *arguments: Any, memory: Any, **options: Any):
        super().__init__(*arguments, **options)
        self.at_once = FRAMES

    def see_all(self, frames: Sequence[Frame]) -> list[Events]:
        assert all(isinstance(frame.light, torch.Tensor) for frame in frames)
        self.given.append(len(frames))
        return super().see_all([downloaded(frame) for frame in frames])

    def step(self, light: Any, *rest: Any) -> Events:
        return super().step(np.asarray(light), *rest)


class Downloading(Cis):
    """A frame camera of a CPU in the place of one on a card."""

    def __init__(self, *arguments: Any, memory: Any, **options: Any):
        super().__init__(*arguments, **options)

    def exposures(self, frame: Frame) -> Iterator[Exposure]:
        assert isinstance(frame.light, torch.Tensor)
        return super().exposures(downloaded(frame))


@pytest.fixture
def gathering(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Sensors on a card are these; returns how many frames they are given, time by time."""
    monkeypatch.setattr("vid2ev.sensors.dvs_on_card.DvsOnCard", Gathering)
    monkeypatch.setattr("vid2ev.sensors.cis_on_card.CisOnCard", Downloading)
    monkeypatch.setattr(Gathering, "given", [])
    return Gathering.given


@pytest.fixture
def clip_with_a_cut(tmp_path: Path) -> Path:
    """A picture that moves, and after 20 frames another, each fading slowly."""
    draws, frames = np.random.default_rng(2), []
    for picture in np.kron(draws.random((2, 12, 16)), np.ones((5, 5)))[:, :48, :64]:
        frames += [np.roll(picture, k // 3, 1) * (1 - 0.01 * k) + 0.01 for k in range(20)]
    np.save(tmp_path / "cut.npy", np.array(frames, np.float32))
    return tmp_path / "cut.npy"


def assert_same(one: Path, other: Path) -> None:
    """The same files, to the byte, and the same manifest, but for the run."""
    names = sorted(str(path.relative_to(one)) for path in one.rglob("*") if path.is_file())
    assert names == sorted(str(path.relative_to(other)) for path in other.rglob("*") if path.is_file())
    for name in names:
        if Path(name).name == "manifest.json":
            first, second = (json.loads((folder / name).read_text()) for folder in (one, other))
            assert (first.pop("run")["device"]["used"], second.pop("run")["device"]["used"]) == ("cpu", "simulated")
            assert first == second
        else:
            assert (one / name).read_bytes() == (other / name).read_bytes(), name


def together() -> Rig:
    cameras = (
        Camera(name="left", kind="dvs"),
        Camera(name="late", kind="dvs", clock_offset_us=1500, seed=8, set={"frame_rate_hz": 300.0}),
    )
    return Rig(source=Source(fov_deg=60.0), cameras=cameras)


@pytest.mark.parametrize(
    "changed",
    [
        {"overrides": NOISY}, {"probe": ["20,16"]}, {"upsample": "none", "subframes": "auto"}, {"bayer": "RGGB"},
        {"rig": together()}, {"effects": "auto", **PLAIN}, {"formats": ["aedat4", "evt3", "csv"], "frames": "npz"},
    ],
    ids=lambda changed: next(iter(changed)),
)  # fmt: skip
def test_the_files_are_those_of_the_cpu(tmp_path, gathering, changed):
    """Cross-fades are the same to the bit, and what sensors are given many at a time makes no other file."""
    options = OPTIONS | changed
    convert(CLIP, tmp_path / "one", **options)
    assert not gathering
    convert(CLIP, tmp_path / "other", device="simulated", **options)
    assert_same(tmp_path / "one", tmp_path / "other")
    assert max(gathering) == (1 if "probe" in changed else FRAMES)


def test_frames_of_a_frame_camera_are_those_of_the_cpu(tmp_path, gathering):
    """Beside one that sees colours, event cameras see luminance that is mixed from them, which is rounded as it is
    mixed: otherwise in tensors than in arrays."""
    options = OPTIONS | {"cis": "paper", "overrides": ["crossing_noise=0", "cis.frame_rate_hz=40"], "preview": False}
    convert(CLIP, tmp_path / "one", **options)
    convert(CLIP, tmp_path / "other", device="simulated", **options)
    one, other = (raw(tmp_path / name) for name in ("one", "other"))
    np.testing.assert_array_equal(one, other)
    assert len(one) > 10
    # Where light rises by 0.02 nat/s, 1e-7 nat are 5 us.
    assert_about_the_same(tmp_path / "one" / "dvs", tmp_path / "other" / "dvs", 1000, most_us=5)


@pytest.mark.parametrize("cuts", ["restart", "keep"])
def test_shots_are_those_of_the_cpu(tmp_path, gathering, clip_with_a_cut, cuts):
    options = OPTIONS | {"fps": 100, "cuts": cuts}
    manifest = convert(clip_with_a_cut, tmp_path / "one", **options)
    convert(clip_with_a_cut, tmp_path / "other", device="simulated", **options)
    assert len(manifest["cuts_us"]) == (cuts == "restart")
    assert_same(tmp_path / "one", tmp_path / "other")


def test_views_are_those_of_the_cpu(tmp_path, gathering):
    """A turned camera before a plane; its light is sampled where it is, within some float32 units in the last place."""
    cameras = (
        Camera(name="here", kind="dvs"),
        Camera(name="beside", kind="dvs", translation_mm=(40.0, 0.0, 0.0), rotation_deg=(0.0, 1.0, 3.0)),
    )
    rig = Rig(source=Source(fov_deg=60.0), cameras=cameras)
    options = OPTIONS | {"rig": rig, "depth": "plane:2", "overrides": ["crossing_noise=0"], "truth": "depth,mask"}
    convert(CLIP, tmp_path / "one", **options)
    convert(CLIP, tmp_path / "other", device="simulated", **options)
    for name in ("here", "beside"):
        assert_about_the_same(tmp_path / "one" / name, tmp_path / "other" / name, 1000, most_us=5)
        masks = [sorted((tmp_path / made / name / "truth" / "mask").iterdir()) for made in ("one", "other")]
        assert all(one.read_bytes() == other.read_bytes() for one, other in zip(*masks, strict=True))


def raw(recording: Path) -> np.ndarray:
    """The pictures of the frame camera of a recording, codes of its ADC."""
    paths = sorted((recording / "cis" / "raw").glob("*.png"))
    return np.array([cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in paths], np.int64)


class Stopped(Exception):
    """Somebody ends the program."""


@pytest.mark.parametrize("devices", [("simulated", "simulated"), ("simulated", "cpu"), ("cpu", "simulated")])
def test_what_is_interrupted_goes_on_on_any_device(tmp_path, gathering, devices):
    """A checkpoint after every frame, of what the sensor has seen until then."""
    options = OPTIONS | {"overrides": NOISY, "piece": 1, "preview": False}
    convert(CLIP, tmp_path / "whole", **options)
    seen = []

    def stop(*_: Any) -> None:
        seen.append(1)
        if len(seen) == 17:
            raise Stopped

    with pytest.raises(Stopped):
        convert(CLIP, tmp_path / "out", device=devices[0], report=stop, **options)
    convert(CLIP, tmp_path / "out", device=devices[1], resume=True, **options)
    assert (tmp_path / "out" / "events.h5").read_bytes() == (tmp_path / "whole" / "events.h5").read_bytes()
    assert max(gathering) == 3, "no more frames than there are between two checkpoints"


def test_plans_that_are_made_again_make_the_same_recording(tmp_path, gathering, monkeypatch):
    """Light that trembles from some frame on, when what was left out before matters: the recording begins again."""
    monkeypatch.setattr(planner, "HELD", 10 * 40 * 30 * 4)
    draws = np.random.default_rng(3)
    ramp = 0.2 + 0.01 * np.arange(30)[:, None, None] * np.ones((1, 30, 40))
    wild = ramp[-1] * np.exp(draws.normal(0, 0.3, (40, 30, 40)))
    np.save(tmp_path / "clip.npy", np.concatenate([ramp, wild]).astype(np.float32))
    options = PLAIN | {"upsample": "none", "cuts": "keep", "fps": 200, "effects": "auto", "threads": 1}
    convert(tmp_path / "clip.npy", tmp_path / "one", **options)
    convert(tmp_path / "clip.npy", tmp_path / "other", device="simulated", **options)
    assert_same(tmp_path / "one", tmp_path / "other")
    assert sum(gathering) > 70, "it began again"


def test_light_along_motion_moves_events_by_a_microsecond(tmp_path, gathering, clip_with_a_cut):
    """Light differs by what float32 rounds of motion (1e-6 of it and less): of an event that is due at the end of a
    microsecond the next one may be told, and no event is missing or added where no pixel only just touches a level."""
    options = {"fps": 100, "overrides": ["crossing_noise=0"], "preview": False, "subframes": 4, "threads": 1}
    convert(clip_with_a_cut, tmp_path / "one", **options)
    convert(clip_with_a_cut, tmp_path / "other", device="simulated", **options)
    assert_about_the_same(tmp_path / "one", tmp_path / "other", 10_000)


SCENE = """
[scene]
duration_s = 0.012
samples = 1
background = [0.02, 0.02, 0.02]
ambient = 1.0
[camera]
size = [14, 14]
fov_deg = 80
[[objects]]
name = "ball"
kind = "sphere"
size_m = [1, 1, 1]
trajectory = { kind = "keyframes", times_s = [0, 1], positions_m = [[-0.5, 0, 2], [60, 0, 2]] }
"""


@pytest.mark.parametrize("pair", [False, True])
def test_a_scene_is_painted_on_the_card(tmp_path, gathering, pair):
    """Pictures in the simulator are those of the CPU to the bit; the luminance that is mixed of them is rounded
    otherwise."""
    cameras = (Camera(name="a", kind="dvs"), Camera(name="b", kind="dvs", translation_mm=(30.0, 0.0, 0.0)))
    options: dict[str, Any] = {"sensor": "ideal", "fps": 500, "preview": False}
    options |= {"rig": Rig(cameras=cameras), "truth": "depth,flow", "truth_rate_hz": 500.0} if pair else {}
    (tmp_path / "ball.toml").write_text(SCENE)
    convert(tmp_path / "ball.toml", tmp_path / "one", **options)
    convert(tmp_path / "ball.toml", tmp_path / "other", device="simulated", **options)
    for name in ("a", "b") if pair else ("",):
        assert_about_the_same(tmp_path / "one" / name, tmp_path / "other" / name, 20, most_us=5)
        for kind in ("depth", "flow") if pair else ():
            files = [sorted((tmp_path / made / name / "truth" / kind).iterdir()) for made in ("one", "other")]
            assert files[0]
            assert all(one.read_bytes() == other.read_bytes() for one, other in zip(*files, strict=True))


@pytest.mark.slow
def test_all_of_it_with_a_simulated_card(tmp_path):
    options = {"sensor": "ideal", "subframes": 2, "preview": False}
    small = "synthetic:moving-edge,size=24x24,fps=100,duration_s=0.04"
    convert(small, tmp_path / "one", **options)
    manifest = convert(small, tmp_path / "other", device="simulated", **options)
    assert manifest["run"]["device"] == {"asked": "simulated", "used": "simulated", "why": "as asked for"}
    assert_about_the_same(tmp_path / "one", tmp_path / "other", 100)


@pytest.mark.slow
def test_a_frame_camera_beside_it(tmp_path):
    np.save(tmp_path / "tiny.npy", np.exp(np.random.default_rng(1).normal(-2, 0.7, (11, 6, 8))).astype(np.float32))
    options = {"sensor": "ideal", "cis": "paper", "overrides": ["cis.frame_rate_hz=50"], "upsample": "none", "fps": 100}
    convert(tmp_path / "tiny.npy", tmp_path / "one", **options)
    convert(tmp_path / "tiny.npy", tmp_path / "other", device="simulated", **options)
    assert_about_the_same(tmp_path / "one" / "dvs", tmp_path / "other" / "dvs", 40, most_us=5)
    one, other = (raw(tmp_path / name) for name in ("one", "other"))
    np.testing.assert_array_equal(one, other)
    assert len(one) > 3


def assert_about_the_same(one: Path, other: Path, least: int, most_us: int = 1) -> None:
    """The same events pixel by pixel, at least so many, of which one in a hundred is told at another microsecond."""
    pixels = []
    for folder in (one, other):
        events = Events.concatenate(read_events(folder))
        order = np.lexsort((events.t, events.x, events.y))
        pixels.append(np.stack([events.y, events.x, events.p, events.t])[:, order].astype(np.int64))
    assert pixels[0].shape == pixels[1].shape and pixels[0].shape[1] > least
    np.testing.assert_array_equal(pixels[0][:3], pixels[1][:3])
    moved = np.abs(pixels[0][3] - pixels[1][3])
    assert moved.max() <= most_us and moved.mean() < 0.01


# --------------------------------------------------------------------------------------------------- which device


@pytest.fixture
def no_card(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "missing_for_cuda", lambda: "torch sees no GPU")


@pytest.fixture
def a_card(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "missing_for_cuda", lambda: "")


@pytest.mark.parametrize(
    ("there", "driver", "compilers", "said"),
    [
        (True, (13, 0), "13.5.0", ""),
        (True, (13, 2), "12.9.1", ""),
        (True, (12, 8), "13.5.0", "driver is for CUDA 12.8, and numba-cuda's compilers are for CUDA 13 .*cuda12"),
        (False, (13, 0), "13.5.0", "no compilers .*, or no driver"),
    ],
)
def test_a_card_is_one_that_kernels_can_be_compiled_for(monkeypatch, there, driver, compilers, said):
    from numba import cuda

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(cuda, "is_available", lambda: there)
    monkeypatch.setattr("numba.cuda.cudadrv.driver.driver.get_version", lambda: driver)
    monkeypatch.setattr(devices, "version", lambda name: compilers)
    assert re.search(said, devices.missing_for_cuda()) if said else devices.missing_for_cuda() == ""


def vid2ev(*arguments: str) -> Any:
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    return result


QUICK = ["convert", CLIP, "--upsample", "none", "--threads", "1", "--no-preview"]


@pytest.mark.usefixtures("no_card")
def test_without_a_card_one_line_says_so_and_the_cpu_does_it(tmp_path):
    result = vid2ev(*QUICK, "-o", str(tmp_path / "out"), "--device", "cuda")
    (line,) = [line for line in result.stderr.splitlines() if "device" in line]
    assert line == "device cuda: torch sees no GPU; converting on the CPU"
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["run"]["device"] == {"asked": "cuda", "used": "cpu", "why": "torch sees no GPU"}
    assert not vid2ev(*QUICK, "-o", str(tmp_path / "out"), "--device", "cuda", "--overwrite", "-q").stderr


@pytest.mark.usefixtures("no_card")
def test_auto_says_where_in_the_summary_alone(tmp_path):
    result = vid2ev(*QUICK, "-o", str(tmp_path / "out"), "--device", "auto")
    assert "device" not in result.stderr and "device    cpu: about " in result.stdout
    assert "device    cpu: about " in vid2ev(*QUICK, "--device", "auto", "--dry-run").stdout
    assert "device" not in vid2ev(*QUICK, "--dry-run").stdout


@pytest.mark.usefixtures("a_card")
def test_auto_takes_the_card_where_there_is_enough_to_do():
    hour = Work(1280 * 720, 3600 * 30, 17.0)
    assert device_for("auto", hour, 2).name == "cuda"
    assert device_for("auto", hour._replace(frames=30), 2).name == "cpu"
    assert device_for("auto", hour._replace(frames=300), 1).name == "cuda"
    assert device_for("auto", hour._replace(frames=300), 16).name == "cpu", "as many threads as that are as fast"
    assert device_for("cuda", hour._replace(frames=1), 2).name == "cuda", "who asks for it gets it"
    assert device_for("cpu", hour, 2).name == "cpu"


@pytest.mark.usefixtures("a_card")
def test_of_a_source_of_unknown_length_size_alone_decides():
    large, small = Work(3840 * 2160, None, 17.0), Work(64 * 48, None, 17.0)
    assert device_for("auto", large, 2).name == "cuda" and device_for("auto", small, 2).name == "cpu"
    assert f"its length is unknown, and taken for {UNKNOWN_FRAMES} frames" in device_for("auto", small, 2).why
    assert " s of 2 threads, and " in device_for("auto", small, 2).why
    assert " s of 1 thread, and " in device_for("auto", small, 1).why


def test_little_is_known_to_be_little_without_looking_for_a_card(monkeypatch):
    monkeypatch.setattr(devices, "missing_for_cuda", lambda: pytest.fail("torch takes a second to load"))
    assert device_for("auto", Work(64 * 48, 100, 1.0), 2).name == "cpu"


def test_a_device_that_there_is_not_is_refused(tmp_path):
    with pytest.raises(UsageError, match="device 'tpu': expected one of cpu, cuda, auto"):
        convert(CLIP, tmp_path / "out", device="tpu")
    assert not list(tmp_path.iterdir())
