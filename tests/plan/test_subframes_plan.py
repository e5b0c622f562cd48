"""Sub-frames in plans: the estimate is the upsampler's, and near what is measured; still intervals take no work."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vid2ev import convert
from vid2ev.plan.recordings import plans_of
from vid2ev.plan.subframes import Subframes
from vid2ev.recording.manifest import read_manifest
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.recipe import Recipe
from vid2ev.stream import Frame
from vid2ev.upsample.flow import FlowUpsampling
from vid2ev.upsample.motion import FEWEST
from vid2ev.upsample.subframes import KAPPA_PER_PX, TOLERANCE_S, steps_for

INTERVAL_NS = 20_000_000


def texture(shift_px: float, size: tuple[int, int] = (160, 120)) -> np.ndarray:
    """Light of noise that moved to the right, through a lens blur of 0.7 px and over the area of pixels; periodic."""
    width, height = size
    white = np.fft.rfft2(np.random.default_rng(7).normal(0, 0.35, (height, width)))
    fx, fy = np.fft.rfftfreq(width)[None, :], np.fft.fftfreq(height)[:, None]
    lens = np.exp(-2 * (np.pi * 0.7) ** 2 * (fx**2 + fy**2)) * np.sinc(fx) * np.sinc(fy)
    moved = np.fft.irfft2(white * lens * np.exp(-2j * np.pi * fx * shift_px), (height, width))
    return np.clip(0.5 + moved, 0.02, None).astype(np.float32)


def instant(light: np.ndarray, t_ns: int, shift_px: float | None, original: bool = True) -> Instant:
    return Instant((Frame(light, t_ns, original),), t_ns, original, shift_px=shift_px)


@pytest.mark.parametrize("shift_px", [0.1, 0.3, 0.6])
def test_the_estimate_is_near_what_a_straight_line_misplaces(shift_px: float) -> None:
    """The median over steep places of how much later, or sooner, the light of the middle is on the straight line."""
    before, middle, after = (texture(share * shift_px) for share in (0, 0.5, 1))
    found = Subframes()
    found.see(instant(before, 0, None))
    found.see(instant(after, INTERVAL_NS, shift_px))
    slope = np.abs(after - before) / (INTERVAL_NS * 1e-9)
    off_s = np.abs(0.5 * (before + after) - middle) / np.maximum(slope, 1e-9)
    measured_us = 1e6 * float(np.median(off_s[slope > np.percentile(slope, 50)]))
    assert measured_us / 3 < found.worst_us < 3 * measured_us
    assert found.worst_us == pytest.approx(1e6 * KAPPA_PER_PX * shift_px * INTERVAL_NS * 1e-9 / 8)


def test_what_is_made_keeps_to_the_upsampler_s_tolerance() -> None:
    """By the same formula as the number of steps."""
    draws, light = np.random.default_rng(1), np.zeros((2, 2), np.float32)
    for _ in range(50):
        shift_px, seconds = draws.uniform(0.05, 30), draws.uniform(1e-3, 0.1)
        found, end_ns, steps = Subframes(), int(seconds * 1e9), 1
        found.see(instant(light, 0, None))
        steps = steps_for(shift_px, end_ns * 1e-9)
        for k in range(1, steps):
            found.see(instant(light, k, shift_px, original=False))
        found.see(instant(light + 1, end_ns, shift_px))
        row = found.row()
        assert found.made == steps - 1 and row.fate == "kept" and row.omission.kind == "estimate"
        assert found.left_us <= 1e6 * TOLERANCE_S * (1 + 1e-9)
        assert found.left_us == pytest.approx(found.worst_us / steps**2)
        assert found.speed_px_per_s == pytest.approx(shift_px / (end_ns * 1e-9))
        assert not row.omission.sure and f"{steps - 1} made" in row.omission.figure
        assert (row.ns_per_pixel > 0) == (steps > 1)


def test_the_worst_interval_counts() -> None:
    """Of all cameras: an interval is still where the light of all of them is."""
    light, found = np.zeros((2, 2), np.float32), Subframes()
    for k, shift_px in enumerate((None, 0.5, 4.0, 1.0)):
        frames = Frame(light + k, k * INTERVAL_NS), Frame(light, k * INTERVAL_NS)
        found.see(Instant(frames, k * INTERVAL_NS, shift_px=shift_px))
    assert found.worst_us == found.left_us == pytest.approx(1e6 * KAPPA_PER_PX * 4.0 * INTERVAL_NS * 1e-9 / 8)
    assert found.speed_px_per_s == pytest.approx(4.0 / (INTERVAL_NS * 1e-9))
    assert (found.intervals, found.still) == (3, 0)
    assert (found.row().fate, found.row().ns_per_pixel) == ("kept", 0.0)  # (of sub-frames none are made)


def test_a_still_clip_needs_no_subframes_and_no_flow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no pixel changes, and where fewer change visibly than make a step: the same frames, and no work."""
    up = FlowUpsampling("auto", 64, 0.15)
    light = texture(0)
    faint = light * np.float32(1.05)
    few = light.copy()
    few[10 : 10 + 2, 10:14] *= 3
    changed = [Frame(each, INTERVAL_NS) for each in (light.copy(), faint, few)]
    with_flow = [list(FlowUpsampling("auto", 64, 0.15).between(Frame(light, 0), each)) for each in changed]

    def looked(*_: object) -> None:
        raise AssertionError("flow is looked for")

    monkeypatch.setattr(up._estimator, "_dis", SimpleNamespace(calc=looked))
    for each, expected in zip(changed, with_flow, strict=True):
        made = up.between(Frame(light, 0), each)
        assert [*made] == expected == [each] and made.shift_px == 0.0
    with pytest.raises(AssertionError, match="flow"):
        up.between(Frame(light, 0), Frame(texture(2), INTERVAL_NS))
    assert FEWEST > 8
    found = Subframes()
    for k in range(4):
        found.see(instant(light.copy(), k * INTERVAL_NS, 0.0))
    row = found.row()
    assert (row.fate, row.omission.kind, row.omission.distance) == ("dropped", "exact", 0.0)
    assert (found.intervals, found.still) == (3, 3)


def test_the_table_counts_what_a_recording_makes(tmp_path: Path) -> None:
    clip = np.stack([texture(2.5 * k, (48, 36)) for k in range(5)])
    np.save(tmp_path / "clip.npy", clip)
    options = {"fps": 30.0, "sensor": "ideal"}
    video = tmp_path / "clip.npy"
    row = plans_of(Recipe.of(video, **options))[""].rows[0]
    manifest = convert(video, tmp_path / "out", **options, effects="auto", preview=False)
    made = manifest["counts"]["subframes"]
    assert made > 10 and row.effect == "subframes" and f"{made} made" in row.omission.figure
    assert read_manifest(tmp_path / "out")["plan"][""]["rows"][0] == row.describe()
    single = plans_of(Recipe.of(video, subframes=1, **options))[""].rows[0]
    assert (single.fate, single.omission.kind, single.ns_per_pixel) == ("kept", "no bound yet", 0.0)
    for method in ("none", "linear"):
        rows = plans_of(Recipe.of(video, upsample=method, **options))[""].rows
        assert [row.effect for row in rows] == []
    shifts = [each.shift_px for each in instants(Recipe.of(video, **options))]
    assert shifts[0] is None and all(shift is not None and shift > 1 for shift in shifts[1:])


def test_a_rig_s_manifests_hold_the_plans(tmp_path: Path) -> None:
    clip = "synthetic:moving-edge,size=48x32,duration_s=0.1"
    options = {"sensor": "ideal", "frame_camera": True, "overrides": ["cis.noise_lsb=0", "cis.exposure_us=10"]}
    whole = convert(clip, tmp_path / "a", **options, effects="auto", tolerance=1.0, preview=False)
    assert list(whole["plan"]) == ["dvs", "cis"]
    assert whole["plan"]["cis"]["max_lsb"] < 0.29
    part = read_manifest(tmp_path / "a" / "cis")
    assert part["plan"] == {"cis": whole["plan"]["cis"]} and part["sensor"]["parameters"]["blur"] is False
