"""Filter, noise and random phase off, the sensor is ESIM: parity with the published algorithm in float64."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vid2ev.sensors.presets import load_sensor

from .clips import play
from .judge import judge
from .reference import Pixel, esim, signal

VIDEOS = Path(__file__).parents[2] / "../shared/data/videos"
ON, OFF = 0.17, 0.23


def ideal():
    return load_sensor("ideal", [f"threshold_on={ON}", f"threshold_off={OFF}"])


def both(t_ns: np.ndarray, light: np.ndarray):
    """Events of the sensor and of ESIM, each sorted by pixel and then time."""
    light = light.astype(np.float32)
    sent = play(ideal(), t_ns, light)
    at = sent.y.astype(np.int64) * light.shape[2] + sent.x
    order = np.argsort(at, kind="stable")
    log_frames = np.log(light.reshape(len(light), -1).astype(np.float64) + 1e-3)
    return at[order], sent.select(order), esim(t_ns, log_frames, ON, OFF)


def assert_same(t_ns, light) -> int:
    at, sent, want = both(t_ns, light)
    assert len(at) == len(want)
    assert (at == want.pixel).all() and (sent.p == want.p).all()
    assert np.abs(sent.t * 1e3 - float(t_ns[0]) - want.t).max() <= 1001
    return len(want)


def assert_nearly_same(t_ns, light) -> None:
    """At most 0.1 % differ, and only by less than 1e-6 nat: where they do, the judge finds both right to that."""
    at, sent, want = both(t_ns, light)
    t_sent = sent.t * 1e3 - float(t_ns[0])
    differ = 0
    for pixel in range(light[0].size):
        mine, theirs = at == pixel, want[want.pixel == pixel]
        same_order = mine.sum() == len(theirs) and (sent.p[mine] == theirs.p).all()
        if same_order and np.all(np.abs(t_sent[mine] - theirs.t) <= 1001):
            continue
        # Pair what can be paired, in order; the rest differs.
        left = list(zip(theirs.t, theirs.p, strict=True))
        for t, p in zip(t_sent[mine], sent.p[mine], strict=True):
            pair = next((k for k, (when, way) in enumerate(left) if way == p and abs(when - t) <= 1001), None)
            if pair is None:
                differ += 1
            else:
                del left[pair]
        differ += len(left)
        trace = light.reshape(len(light), -1)[:, pixel].astype(np.float32)
        of = signal(Pixel(ON, OFF, filter="after"), t_ns, trace)
        judge(of, t_sent[mine], sent.p[mine], slack=1e-6)
        judge(of, theirs.t, theirs.p, slack=1e-6)
    assert len(want) > 1000
    assert differ <= 1e-3 * len(want)


def photograph_pan(step_px: float = 0.5, frames: int = 40) -> np.ndarray:
    """8-bit codes [F, 48, 64] of a camera that sweeps over a photograph and back."""
    from skimage import data

    photo = data.camera().astype(np.float64)
    path = np.concatenate([np.arange(frames // 2), np.arange(frames // 2)[::-1]]) * step_px
    low = path.astype(int)
    share = (path - low)[:, None, None]
    rows = photo[200:248]
    blend = np.stack([rows[:, k + 150 : k + 215] for k in low])
    return np.rint(blend[:, :, :-1] * (1 - share) + blend[:, :, 1:] * share).astype(np.uint8)


def from_srgb(codes: np.ndarray) -> np.ndarray:
    v = codes / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def test_random_light():
    rng = np.random.default_rng(1)
    t_ns = 12_345_678 + np.cumsum(rng.integers(1_000, 50_000_000, 60))
    light = 10 ** rng.uniform(-4, 2, (60, 16, 24))
    assert assert_same(t_ns, light) > 100_000


def test_random_light_at_video_rate_three_hours_in():
    rng = np.random.default_rng(2)
    t_ns = 10_800_000_000_000 + np.rint(np.arange(40) / 29.97 * 1e9).astype(np.int64)
    light = np.clip(np.cumsum(rng.normal(0, 0.05, (40, 24, 24)), axis=0) + 0.5, 0, None)
    assert assert_same(t_ns, light) > 5_000


@pytest.mark.parametrize("curve", [from_srgb, lambda codes: codes / 255], ids=["srgb", "linear"])
def test_coded_clip_dithered(curve):
    rng = np.random.default_rng(3)
    codes = photograph_pan()
    light = np.clip(curve(codes) + rng.uniform(0, 1e-4, codes.shape), 0, None)
    assert assert_same(np.arange(40) * 1_000_000, light) > 5_000


@pytest.mark.parametrize("curve", [from_srgb, lambda codes: codes / 255], ids=["srgb", "linear"])
def test_coded_clip_raw(curve):
    """The pan returns to its start, so that many pixels end exactly on a level."""
    assert_nearly_same(np.arange(40) * 1_000_000, curve(photograph_pan()))


@pytest.mark.parametrize(("name", "y", "x"), [("intel_asl_again.mkv", 240, 260), ("nasa_13013.mp4", 40, 80)])
def test_video_raw(name, y, x):
    if not (VIDEOS / name).exists():
        pytest.skip(f"needs {name} of the shared data")
    import av

    with av.open(str(VIDEOS / name)) as container:
        frames = []
        for frame in container.decode(video=0):
            frames.append(frame.to_ndarray(format="gray")[y : y + 80, x : x + 120])
            if len(frames) == 60:
                break
    t_ns = np.rint(np.arange(len(frames)) / 29.97 * 1e9).astype(np.int64)
    assert_nearly_same(t_ns, from_srgb(np.stack(frames)))
