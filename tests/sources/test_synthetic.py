"""Synthetic clips do what their formula says."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.sources import open_source
from vid2ev.sources.synthetic import SYNTHETIC, MovingEdge, parse_synthetic


@pytest.mark.parametrize("name", SYNTHETIC)
def test_every_clip_is_a_source(name: str) -> None:
    source = open_source(f"synthetic:{name},size=9x5,fps=100,duration_s=0.05")
    frames = list(source.frames())
    assert source.size == (9, 5) and len(frames) == source.frames_expected == 6
    assert [frame.t_ns for frame in frames] == [k * 10_000_000 for k in range(6)]
    assert all(frame.light.shape == (5, 9) and frame.light.dtype == np.float32 for frame in frames)
    assert all(np.isfinite(frame.light).all() and (frame.light >= 0).all() for frame in frames)
    for a, b in zip(source.frames(4), frames[4:], strict=True):
        assert a.t_ns == b.t_ns and np.array_equal(a.light, b.light)
    about = source.describe()
    assert about["name"] == name and about["size"] == [9, 5] and about["duration_s"] == 0.05


def test_a_ramp_is_even_in_log_light() -> None:
    clip = parse_synthetic("ramp,size=1x1,low=0.01,high=1,duration_s=2,fps=10")
    logs = [math.log(frame.light[0, 0]) for frame in clip.frames()]
    np.testing.assert_allclose(np.diff(logs), math.log(100) / 20, rtol=1e-5)


def test_a_sine_swings_by_its_amplitude() -> None:
    clip = parse_synthetic("sine,size=1x1,frequency_hz=5,amplitude_nat=0.7,mean=0.3,fps=1000")
    logs = np.log([frame.light[0, 0] for frame in clip.frames()])
    times = np.arange(1001) / 1000
    np.testing.assert_allclose(logs, math.log(0.3) + 0.7 * np.sin(2 * np.pi * 5 * times), atol=1e-6)


def test_a_step_and_a_flash_happen_when_they_should() -> None:
    step = [frame.light[0, 0] for frame in parse_synthetic("step,size=1x1,fps=10,at_s=0.5").frames()]
    assert step == [np.float32(0.1)] * 5 + [np.float32(0.5)] * 6
    flash = parse_synthetic("flash,size=1x1,fps=10,at_s=0.3,length_s=0.15")
    assert [frame.light[0, 0] for frame in flash.frames()] == [0, 0, 0, 1e6, 1e6, 0, 0, 0, 0, 0, 0]
    for at in range(0, 500, 7):
        flash = parse_synthetic(f"flash,size=1x1,fps=1000,duration_s=1,at_s={at / 1000},length_s=0.05")
        lit = [k for k, frame in enumerate(flash.frames()) if frame.light[0, 0] > 0]
        assert lit == list(range(at, at + 50))


def test_an_edge_crosses_when_it_should() -> None:
    clip = MovingEdge(size=(64, 2))
    for x in (10, 33, 60):
        for light in (0.11, 0.35, 0.59):
            behind_px = clip.width * NormalDist().inv_cdf((light - clip.low) / (clip.high - clip.low))
            t_ns = round((x - clip.start + behind_px) / clip.speed * 1e9)
            assert clip.light(t_ns)[1, x] == pytest.approx(light, abs=1e-6)


@pytest.mark.parametrize(
    "text",
    ["", "nothing", "ramp,speed=3", "ramp,fps", "ramp,fps=fast", "ramp,size=4", "ramp,size=0x4", "ramp,fps=0",
     "ramp,duration_s=-1", "ramp,duration_s=0", "ramp,low=0", "ramp,low=-1", "moving-edge,width=0",
     "sine,amplitude_nat=1e3", "step,low=-1", "flash,dark=-1", "ramp,low=nan", "ramp,warnings=3",
     "sine,frequency_hz=1e308", "flash,at_s=1e300", "flash,length_s=1e300", "moving-edge,high=1e300",
     "black,size=65536x1", "black,size=1x65536"],
)  # fmt: skip
def test_refusals(text: str) -> None:
    with pytest.raises(UsageError):
        open_source(f"synthetic:{text}")


def test_light_needs_no_transfer() -> None:
    with pytest.raises(UsageError, match="linear already"):
        open_source("synthetic:ramp", transfer="srgb")
    assert open_source("synthetic:ramp", fps=50).frames_expected == 51
