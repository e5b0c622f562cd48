"""Light made in tensors of torch is that made in arrays.  The device is the CPU; the text is that for a card."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage import data

from vid2ev import open_source
from vid2ev.stream.frames import Frame
from vid2ev.stream.upload import Upload, downloaded
from vid2ev.upsample import flow, make_upsampler, warp, warp_tensors
from vid2ev.upsample.mended import mended

F = np.float32
VIDEOS = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos"
# Of the brightest light.  Both round each operation in the same way, but for the sums of velocities: these differ by a
# few 2**-24 of themselves, that is by up to 1e-5 px where things move by some px, and light beside an edge, which
# changes by less than its brightest per px, as much.  Nearly everywhere both are the same to the bit.
MOST, MEAN = 3e-5, 1e-8


@pytest.fixture(autouse=True)
def one_thread():
    """Small tensors are done by one thread before others are awake."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def made(method: str, a: np.ndarray, b: np.ndarray, steps: int, upload: Upload | None = None) -> list[Frame]:
    return list(make_upsampler(method, steps, upload=upload).between(Frame(a, 1000), Frame(b, 33_334_333)))


def both(method: str, a: np.ndarray, b: np.ndarray, steps: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Light in arrays and in tensors, instant by instant."""
    ours, there = made(method, a, b, steps), made(method, a, b, steps, Upload("cpu"))
    assert [(frame.t_ns, frame.original) for frame in ours] == [(frame.t_ns, frame.original) for frame in there]
    assert all(isinstance(frame.light, torch.Tensor) and frame.light.dtype == torch.float32 for frame in there)
    return [(one.light, downloaded(other).light) for one, other in zip(ours, there, strict=True)]


def panned(name: str, shift: int, colour: bool = False) -> tuple[np.ndarray, np.ndarray]:
    light = (getattr(data, name)()[100:221, 60:260].astype(F) / 255) ** F(2.2)
    light = light if colour or light.ndim == 2 else light.mean(axis=-1)
    return light[2:-2, :-shift].copy(), light[4:, shift:].copy()


@pytest.mark.parametrize(
    ("name", "shift", "colour"), [("camera", 3, False), ("gravel", 1, False), ("astronaut", 4, True)]
)
def test_a_panned_photograph(name, shift, colour):
    pairs = both("flow", *panned(name, shift, colour), 7)
    assert not np.array_equal(pairs[2][0], pairs[0][0]), "something moves"
    for one, other in pairs:
        assert one.shape == other.shape
        error = np.abs(one - other)
        assert error.max() < MOST * one.max() and error.mean() < MEAN and (error == 0).mean() > 0.9


@pytest.mark.skipif(not VIDEOS.is_dir(), reason="shared clips are not there")
@pytest.mark.parametrize("clip", ["gopro_karma.mp4", "intel_asl_book.mkv", "sam2_02_cups.mp4"])
def test_real_clips(clip):
    frames = open_source(VIDEOS / clip, size="320x180!").frames(5)
    for one, other in both("flow", next(frames).light, next(frames).light, 5):
        error = np.abs(one - other)
        assert error.max() < MOST * one.max() and error.mean() < MEAN and (error == 0).mean() > 0.9


@settings(max_examples=40)
@given(
    width=st.integers(1, 60), height=st.integers(1, 60), steps=st.integers(2, 6), seed=st.integers(0, 2**32 - 1),
    bad=st.booleans(), colour=st.booleans(), alike=st.booleans(),
)  # fmt: skip
def test_any_light_of_any_size(width, height, steps, seed, bad, colour, alike):
    """Noise moves as no scene does; NaN and infinity are what sensors take them for; tiny frames are cross-fades."""
    draws = np.random.default_rng(seed)
    shape = (height, width, 3) if colour else (height, width)
    a = np.exp(draws.normal(0, 1, shape)).astype(F)
    b = a.copy() if alike else np.roll(a, draws.integers(-4, 5, 2), (0, 1))
    if bad:
        for light in (a, b):
            light[draws.integers(height), draws.integers(width)] = draws.choice([np.nan, np.inf, -np.inf])
    with np.errstate(invalid="ignore"):  # (of the luminance in which motion is looked for)
        pairs = both("flow", a, b, steps)
    for k, (one, other) in enumerate(pairs):
        assert k == steps - 1 or np.isfinite(other).all()
        peak = max(np.abs(mended(light)).max() for light in (a, b))
        np.testing.assert_allclose(other, one, rtol=0, atol=20 * MOST * peak)  # (moves farther, changes faster)


def test_cross_fades_are_the_same_to_the_bit():
    draws = np.random.default_rng(1)
    a, b = np.exp(draws.normal(0, 2, (2, 37, 41))).astype(F)
    a[3, 4], b[5, 6] = np.nan, np.inf
    for one, other in both("linear", a, b, 5):
        np.testing.assert_array_equal(one, other)


def test_how_many_instants_are_made_at_a_time_changes_no_bit(monkeypatch):
    pair = panned("camera", 3)
    whole = made("flow", *pair, 9, Upload("cpu"))
    for pixels in (1, 4 * pair[0].size):
        monkeypatch.setattr(flow, "AT_ONCE", pixels)
        for one, other in zip(made("flow", *pair, 9, Upload("cpu")), whole, strict=True):
            assert torch.equal(one.light, other.light) and one.t_ns == other.t_ns


def test_what_is_thrown_is_what_a_cpu_throws():
    """Up to rounding of float32, also where next to nothing of a pixel arrives; what goes outside is gone."""
    draws = np.random.default_rng(4)
    motion, sure = draws.normal(0, 9, (31, 23, 2)).astype(F), draws.random((31, 23)).astype(F)
    motion[draws.random((31, 23)) < 0.3] = 0
    time, there = F(0.3), Upload("cpu").tensor
    field = np.zeros((33, 25, 4), F)
    moving = warp.moving_of(motion, sure, flow.UNSURE, 3, field)
    warp.splat(moving, time, F(-1), F(1) - time, 3, field)
    instants = there(np.array([0.9, 0.3], F))[:, None, None]
    sums = warp_tensors.splat(there(motion), there(sure), float(flow.UNSURE), instants, -1.0, 1 - instants)
    assert sums.dtype == torch.int64 and sums.shape == (3, 2, 33, 25), "whole numbers: any order gives the same"
    ours = sums[:, 1].numpy() * warp_tensors.UNIT
    for k, plane in enumerate((0, 1, 3)):
        np.testing.assert_allclose(ours[k], field[..., plane], rtol=1e-6, atol=1e-6)
    # A place at which all that arrives is below 2**-17 loses more than a unit of float32, the velocity there too.
    faint = (ours[2] > 0) & (ours[2] < 2**-17)
    np.testing.assert_allclose(ours[2][faint], field[..., 3][faint], rtol=0, atol=30 * warp_tensors.UNIT)


def test_light_goes_to_the_device_once(monkeypatch):
    upload, sent = Upload("cpu"), []
    monkeypatch.setattr(upload, "tensor", lambda light: sent.append(light) or torch.tensor(light))
    a, b = np.ones((2, 4, 5), F)
    b.flags.writeable = False
    for light in (a, b, a, b, a):
        assert upload.light(upload.light(light)).shape == (4, 5)
    assert len(sent) == 2
    assert Upload("cpu").light(b).sum() == 20  # (which torch would warn of)
