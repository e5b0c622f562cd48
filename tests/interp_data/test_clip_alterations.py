"""What samples are altered by: still parts, lost events, thresholds that are known less well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import default_collate

from interp.candidates.bridge import bridge
from interp.data import alter
from interp.data.clip import Clip, read_clip, write_clip
from interp.data.samples import SampleSettings, altered
from interp.data.settings import ClipSettings
from interp.data.tensors import as_tensor, tensors
from interp.representation.event_counts import EventCounts


def clip_of(seed: int = 0, coarser: int = 1, light: str = "srgb") -> Clip:
    """A clip of noise: every pixel another value, so that nothing can be mixed up."""
    draw = np.random.default_rng(seed)
    truth = draw.integers(0, 256, (9, 24, 24, 3)).astype(np.uint8)
    if light == "linear":
        truth = (truth / 50).astype(np.float16)
    keys = draw.integers(0, 256, (2, 24, 24, 3)).astype(np.uint8)
    off_on = 1.25 * draw.integers(0, 4, (2, 32, 24 // coarser, 24 // coarser))  # (with what dead time hid)
    return Clip(truth, keys, off_on.astype(np.float16), (0.2, 0.3), 32_000, {})


@pytest.mark.parametrize("contrast", [(1e-6, 0.2), (0.3, 100.0)])
def test_clips_of_all_thresholds_that_sensors_may_have_are_kept(tmp_path: Path, contrast: tuple[float, float]) -> None:
    write_clip(tmp_path / "clip.npy", replace(clip_of(), contrast=contrast))
    assert read_clip(tmp_path / "clip.npy").contrast == contrast


def as_bytes(clip: Clip) -> tuple[bytes, ...]:
    return tuple(np.ascontiguousarray(each).tobytes() for each in (clip.truth, clip.keys, clip.off_on))


@pytest.mark.parametrize("coarser", [1, 2, 3])
def test_turns_and_mirrors_form_their_group(coarser: int) -> None:
    clip = clip_of(coarser=coarser)
    assert as_bytes(alter.mirrored(alter.mirrored(clip))) == as_bytes(clip)
    assert as_bytes(alter.backwards(alter.backwards(clip))) == as_bytes(clip)
    assert alter.backwards(clip).contrast == clip.contrast[::-1]
    assert as_bytes(alter.turned(alter.turned(clip, 1), 3)) == as_bytes(clip)
    turned = alter.turned(clip, 1)
    assert as_bytes(alter.mirrored(turned)) == as_bytes(alter.turned(alter.mirrored(clip), 3))
    np.testing.assert_array_equal(turned.truth[0, 23 - 5, 7], clip.truth[0, 7, 5])
    each = clip.coarser
    np.testing.assert_array_equal(
        turned.off_on[..., (23 - 5) // each, 7 // each], clip.off_on[..., 7 // each, 5 // each]
    )


@pytest.mark.parametrize("coarser", [1, 2])
def test_a_part_has_its_own_events(coarser: int) -> None:
    clip = clip_of(coarser=coarser)
    part = alter.cropped(clip, 4, 8, (16, 8))
    np.testing.assert_array_equal(part.truth, clip.truth[:, 8:16, 4:20])
    np.testing.assert_array_equal(
        part.off_on, clip.off_on[:, :, 8 // coarser : 16 // coarser, 4 // coarser : 20 // coarser]
    )


def test_recordings_of_finer_and_coarser_events_make_one_batch() -> None:
    settings = ClipSettings(recordings=1, recording_folders=("somewhere",))
    clips = [clip_of(coarser=coarser) for coarser in (1, 2, 3)]
    made = default_collate([tensors(clip, settings) for clip in clips])
    assert made["footprint"].tolist() == [1, 2, 3]
    batch = made["off_on"]
    np.testing.assert_array_equal(batch[0], clips[0].off_on)  # (as many as were counted)
    np.testing.assert_array_equal(batch[2, ..., 1::3, 1::3], clips[2].off_on)  # (at the middle of their pixels)


def test_grey_frames_are_those_of_a_grey_camera() -> None:
    """It sees luminance, a sum of light; its codes are nearest to that."""
    clip, codes = clip_of(), np.arange(256) / 255
    curve = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    for ours, theirs in ((grey := alter.grey(clip)).truth, clip.truth), (grey.keys, clip.keys):
        assert ours.dtype == np.uint8 and ours.shape == (*theirs.shape[:3], 1)
        light = curve[theirs] @ [0.2126, 0.7152, 0.0722]
        lower, own, upper = (
            np.abs(curve[np.clip(ours[..., 0].astype(int) + step, 0, 255)] - light) for step in (-1, 0, 1)
        )
        assert (own <= np.minimum(lower, upper) + 1e-4).all()
    assert as_bytes(grey)[2] == as_bytes(clip)[2] and grey.contrast == clip.contrast
    alike = np.repeat(np.arange(256, dtype=np.uint8).reshape(1, 16, 16, 1), 3, 3)
    same = alter.grey(Clip(alike, alike, clip.off_on, clip.contrast, 1, {}))
    np.testing.assert_array_equal(same.truth[..., 0], alike[..., 0])
    bright = clip_of(light="linear")
    np.testing.assert_allclose(
        alter.grey(bright).truth[..., 0], bright.truth.astype(float) @ [0.2126, 0.7152, 0.0722], rtol=1e-3
    )


def test_nothing_happens_in_still_parts() -> None:
    still = np.zeros((24, 24), bool)
    still[:, :10] = True
    clip = clip_of()
    got = alter.stilled(clip, still)
    assert not got.off_on[..., :10].any()
    np.testing.assert_array_equal(got.truth[:, :, :10], np.repeat(clip.truth[:1, :, :10], 9, axis=0))
    np.testing.assert_array_equal(got.off_on[..., 10:], clip.off_on[..., 10:])
    for ours, theirs in ((got.truth, clip.truth), (got.keys, clip.keys)):
        np.testing.assert_array_equal(ours[:, :, 10:], theirs[:, :, 10:])


def test_key_frames_of_still_parts_keep_their_noise_and_lose_their_blur() -> None:
    truth = np.full((9, 24, 24, 3), 100, np.uint8)
    truth[-1] = 180
    keys = np.stack([truth[0] + 3, truth[-1] + 5])
    keys[1, :4] = 100  # blur: far from the instant
    clip = alter.stilled(
        Clip(truth, keys, np.ones((2, 32, 24, 24), np.uint8), (0.2, 0.2), 1, {}), np.ones((24, 24), bool)
    )
    assert (clip.truth == 100).all() and (clip.keys[0, 4:] == 103).all() and (clip.keys[1, 4:] == 105).all()
    assert (clip.keys[:, :4] == 100).all()


def test_a_still_part_that_was_compressed_is_compressed_in_all_frames() -> None:
    smooth = np.broadcast_to(np.linspace(40, 200, 24).astype(np.uint8)[None, None, :, None], (9, 24, 24, 3))
    clip = Clip(smooth.copy(), smooth[[0, -1]].copy(), np.zeros((2, 32, 24, 24), np.uint8), (0.2, 0.2), 1, {})
    got = alter.stilled(clip, np.ones((24, 24), bool), quality=40)
    assert (got.truth == got.truth[0]).all() and (got.keys == got.truth[0]).all()
    difference = np.abs(got.truth[0].astype(int) - smooth[0])
    assert 0 < difference.max() < 30


def test_light_of_still_parts_stays_unclipped() -> None:
    clip = clip_of(light="linear")
    got = alter.stilled(clip, np.ones((24, 24), bool), quality=50)
    np.testing.assert_array_equal(got.truth, np.repeat(clip.truth[:1], 9, axis=0))


def test_the_bridge_leaves_still_parts_alone() -> None:
    got = alter.stilled(clip_of(), np.ones((24, 24), bool))
    got = Clip(got.truth, got.truth[[0, -1]], got.off_on, got.contrast, got.gap_us, {})
    batch = {name: value[None] for name, value in tensors(got, ClipSettings()).items()}
    frames, counts = batch["frames"], EventCounts(batch["off_on"], batch["contrast"])
    made = bridge(frames[:, 0], frames[:, 1], counts, torch.tensor([[0.5]]))
    # (colours are taken as ratios that are kept from dividing by nothing: a code of 255 at most)
    assert (made[0] - as_tensor(got.truth[4:5])).abs().max() < 1 / 255


def test_lost_events_are_a_share_of_all() -> None:
    clip = clip_of()
    got = alter.thinned(clip, np.random.default_rng(0), 0.1)
    assert (got.off_on <= clip.off_on).all()
    # 55 thousand events: the share is 0.1 to five standard deviations of 0.0013.
    assert got.off_on.sum(dtype=float) / clip.off_on.sum(dtype=float) == pytest.approx(0.9, abs=0.0065)


def test_thresholds_are_misjudged_apart() -> None:
    draw, clip = np.random.default_rng(0), clip_of()
    believed = np.array([alter.misjudged(clip, draw, (0.9, 1.1)).contrast for _ in range(500)]) / clip.contrast
    assert believed.min() >= 0.9 and believed.max() <= 1.1
    assert abs(np.corrcoef(believed.T)[0, 1]) < 0.2  # (5 standard deviations of independent ones: 0.22)
    assert believed.std() == pytest.approx(0.2 / np.sqrt(12), rel=0.1)


def test_shares_of_alterations_are_as_asked_for() -> None:
    clip, settings = clip_of(), SampleSettings(size=24, still=0.4, all_still=0.1, thinned=0.0)
    still, all_still, count = 0, 0, 600
    for seed in range(count):
        events = altered(clip, settings, np.random.default_rng(seed)).off_on.sum(dtype=float)
        all_still += events == 0
        still += 0 < events < clip.off_on.sum(dtype=float)
    # (of 600, 0.4 and 0.1 to four standard deviations; a few regions are so small that they hold no event)
    assert still / count == pytest.approx(0.4, abs=0.08)
    assert all_still / count == pytest.approx(0.1, abs=0.05)
