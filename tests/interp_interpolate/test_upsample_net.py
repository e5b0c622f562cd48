"""Light between frames by a network, found by its entry point."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest
import torch
from small_takes import images, moving

from interp import pretrained
from interp.methods import of_networks, tiling
from interp.networks import make
from interp.weights import save
from vid2ev import Frame, convert
from vid2ev.errors import UsageError
from vid2ev.recording.manifest import read_manifest
from vid2ev.stream.upload import Upload
from vid2ev.upsample import make_upsampler, registered


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    net = EntryPoints([EntryPoint("net", "interp.upsampler:make", registered.GROUP)])
    monkeypatch.setattr(registered, "entry_points", lambda **wanted: net.select(**wanted))


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    save(tmp_path / "rrin.safetensors", "rrin", make("rrin"))
    return tmp_path / "rrin.safetensors"


def two_frames(colours: bool) -> list[Frame]:
    lights = [(frame.astype(np.float32) / 255) ** 2.2 for frame in moving(2)]
    return [Frame(light if colours else light[..., 1], 33_333_333 * k) for k, light in enumerate(lights)]


@pytest.mark.parametrize("colours", [False, True])
def test_frames_come_in_even_steps_and_the_last_is_the_frame_itself(weights: Path, colours: bool) -> None:
    a, b = two_frames(colours)
    made = list(make_upsampler(f"net:{weights}", 4).between(a, b))
    assert [frame.t_ns for frame in made] == [8_333_333, 16_666_667, 25_000_000, 33_333_333]
    assert made[-1].light is b.light and [frame.original for frame in made] == [False] * 3 + [True]
    # A network that has learned nothing is a cross-fade of codes.
    for frame, share in zip(made[:-1], (0.25, 0.5, 0.75), strict=True):
        assert frame.light.shape == a.light.shape and frame.light.dtype == np.float32
        between = np.minimum(a.light, b.light) - 1e-4, np.maximum(a.light, b.light) + 1e-4
        assert ((frame.light >= between[0]) & (frame.light <= between[1])).mean() > 0.99
        assert np.abs(frame.light - (a.light + share * (b.light - a.light))).mean() < 0.05


@pytest.mark.parametrize("upload", [None, Upload("cpu")])
def test_infinite_light_that_stays_is_infinite_between_frames(weights: Path, upload: Upload | None) -> None:
    a, b = two_frames(True)
    for frame in (a, b):
        frame.light[3:6, 4:9] = np.inf
    for frame in make_upsampler(f"net:{weights}", 4, upload=upload).between(a, b):
        assert np.array_equal(np.isposinf(np.asarray(frame.light)), np.isposinf(a.light))


@pytest.mark.parametrize("first", [False, True])
def test_light_that_is_infinite_in_one_frame_is_the_most_that_half_floats_hold(weights: Path, first: bool) -> None:
    made = []
    for most in (np.inf, 65504):
        a, b = two_frames(True)
        (a if first else b).light[3:6, 4:9] = most
        made.append([frame.light for frame in make_upsampler(f"net:{weights}", 4).between(a, b)][:-1])
    np.testing.assert_array_equal(*made)
    assert np.max(made) > 1


@pytest.mark.parametrize("colours", [False, True])
def test_on_a_device_light_stays_there_and_is_the_same(weights: Path, colours: bool) -> None:
    a, b = two_frames(colours)
    here, there = (list(make_upsampler(f"net:{weights}", 3, upload=to).between(a, b)) for to in (None, Upload("cpu")))
    for one, other in zip(here, there, strict=True):
        assert isinstance(other.light, torch.Tensor) and one.t_ns == other.t_ns
        np.testing.assert_array_equal(one.light, other.light.numpy())


def test_steps_are_as_motion_asks_and_none_where_nothing_moves(weights: Path) -> None:
    a, b = two_frames(False)
    flow, net = (list(make_upsampler(method).between(a, b)) for method in ("flow", f"net:{weights}"))
    assert [frame.t_ns for frame in net] == [frame.t_ns for frame in flow] and len(net) > 2
    still = list(make_upsampler(f"net:{weights}").between(a, Frame(a.light.copy(), b.t_ns)))
    assert len(still) == 1


def test_light_that_is_not_finite_does_not_stop_it(weights: Path) -> None:
    a, b = two_frames(False)
    a.light[5, 5], b.light[5, 5], b.light[40, 3] = np.inf, np.inf, np.nan
    made = list(make_upsampler(f"net:{weights}", 3).between(a, b))
    assert made[-1].light is b.light
    for frame in made[:-1]:  # (what is infinite in both stays so)
        assert np.argwhere(~np.isfinite(frame.light)).tolist() == [[5, 5]] and not np.isnan(frame.light).any()


def test_a_conversion_says_which_weights_it_was_made_with(tmp_path: Path, weights: Path) -> None:
    source = images(tmp_path / "in", moving(3))
    convert(source, tmp_path / "out", upsample=f"net:{weights}", subframes=2, preview=False, threads=1)
    said = read_manifest(tmp_path / "out")["upsampling"]
    assert said["method"] == f"net:{weights}" and len(said["sha256"]) == 64 and said["weights"] == "rrin.safetensors"


def test_what_cannot_be_meant_is_said(tmp_path: Path, weights: Path) -> None:
    with pytest.raises(UsageError, match=r"expected one of none, linear, flow, net"):
        make_upsampler("nett")
    with pytest.raises(UsageError, match="no such file"):
        make_upsampler(f"net:{tmp_path / 'nothing'}")
    for name, sentence in (("rrin_events", "needs events"), ("hdr", "rebuilds no")):
        save(tmp_path / "other.safetensors", name, make(name))
        with pytest.raises(UsageError, match=sentence):
            make_upsampler(f"net:{tmp_path / 'other.safetensors'}")


def test_without_a_name_the_weights_that_come_with_it_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(list(make_upsampler("net", 2).between(*two_frames(False)))) == 2
    monkeypatch.setattr(pretrained, "OF_FRAMES", ())
    with pytest.raises(UsageError, match="net:WEIGHTS, or choose flow"):
        make_upsampler("net")


def test_large_frames_are_made_in_tiles(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = (Frame(np.random.default_rng(k).random((48, 256), np.float32), 33_333_333 * k) for k in (0, 1))
    whole = list(make_upsampler(f"net:{weights}", 3).between(a, b))
    parts: list[tiling.Tile] = []
    monkeypatch.setattr(of_networks, "part", lambda gap, tile: parts.append(tile) or tiling.part(gap, tile))
    monkeypatch.setattr(tiling, "WHOLE_PX", 1)
    monkeypatch.setattr(tiling, "SIDE", 128)
    for one, other in zip(whole, make_upsampler(f"net:{weights}", 3).between(a, b), strict=True):
        np.testing.assert_allclose(one.light, other.light, atol=1e-5)
    assert len(parts) > 1 and max(tile.right - tile.left for tile in parts) <= 128
