"""Clips of recordings whose event camera is not that of the frames: its events lie where frames saw the same change."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from interp.data.clip import Clip, read_clip, write_clip
from interp.data.layouts import open_sequence
from interp.data.recorded import clip_of, coarser_by, recorded
from interp.data.samples import check_fits
from interp.data.settings import ClipSettings
from interp.data.tensors import tensors
from vid2ev import convert
from vid2ev.recording.exposures import write_codes

SIZE, PART = (64, 48), (8, 12, 40, 24)
STEP_US = 10_000
HERE, UPSIDE_DOWN, BESIDE, UNEVEN = (
    "",
    "rotation_deg = [0, 0, 180]",
    "rotation_deg = [0, 0, 180]\ntranslation_mm = [15, 0, 0]",
    "size = [47, 35]",
)
COARSE = "size = [32, 24]"


def filmed(folder: Path) -> Path:
    draw = np.random.default_rng(0).random((SIZE[1] // 6, 24, 3))
    whole = np.rint(40 + 180 * cv2.resize(draw, (144, SIZE[1]), interpolation=cv2.INTER_CUBIC).clip(0, 1))
    folder.mkdir()
    for k in range(9):
        write_codes(folder / f"{k:06d}.png", whole[:, 2 * k : 2 * k + SIZE[0]].astype(np.uint8))
    (folder / "timestamps.txt").write_text("".join(f"{STEP_US * k}\n" for k in range(9)))
    return folder


def taken(folder: Path, place: str) -> Path:
    """A recording with an event camera that is placed so."""
    rig = folder / "rig.toml"
    folder.mkdir()
    film = filmed(folder / "film")
    rig.write_text(
        f'[[camera]]\nname = "dvs"\nkind = "dvs"\nsensor = "ideal"\n{place}\n'
        '[[camera]]\nname = "cis"\nkind = "cis"\nsensor = "ideal"\nset = { frame_rate_hz = 100 }\n'
    )
    depth = "plane:1" if "translation" in place else None
    convert(film, folder / "made", rig=rig, depth=depth, pictures="png", preview=False, threads=1)
    return folder / "made"


def clip(folder: Path) -> Clip:
    return clip_of(open_sequence(folder), 1, 4, 8, PART)


def apart(one: Clip, other: Clip) -> float:
    """Of the net counts over the gap, as a share of what there is."""
    net, of_other = ((each.off_on[1].astype(float) - each.off_on[0]).sum(0)[4:-4, 4:-4] for each in (one, other))
    return float(np.abs(net - of_other).mean() / np.abs(of_other).mean())


@pytest.mark.parametrize(("place", "most"), [(UPSIDE_DOWN, 0.0), (BESIDE, 0.3), (UNEVEN, 0.3)])
def test_clips_have_their_events_where_the_frames_saw_the_change(tmp_path: Path, place: str, most: float) -> None:
    """As those of a camera in the same place: upside down to the pixel; beside it, and with pixels that lie askew to
    those of the frames, but for what is between pixels."""
    same, other = (taken(tmp_path / str(k), each) for k, each in enumerate((HERE, place)))
    here, there = clip(same), clip(other)
    np.testing.assert_array_equal(there.keys, here.keys)
    assert there.off_on.shape == here.off_on.shape and there.contrast == here.contrast
    assert apart(there, here) <= most


def test_clips_know_how_coarse_events_were_before_they_were_carried(tmp_path: Path) -> None:
    """As `interpolate` does; of pixels that lie edge on edge it is how many counts there are."""
    for k, (place, footprint, across) in enumerate(((COARSE, 2, 20), (f"{COARSE}\n{BESIDE}", 2, 40), (BESIDE, 1, 40))):
        found = clip(taken(tmp_path / str(k), place))
        assert (found.footprint, found.off_on.shape[-1]) == (footprint, across)
        sample = tensors(found, ClipSettings(recordings=1, recording_folders=("somewhere",)))
        assert int(sample["footprint"]) == footprint and sample["off_on"].shape[-1] == 40
        write_clip(tmp_path / "clip.npy", found)
        assert read_clip(tmp_path / "clip.npy").footprint == footprint


def test_samples_of_rigs_need_no_multiple_of_coarse_pixels(tmp_path: Path) -> None:
    folders = (str(taken(tmp_path / "a", UNEVEN)), str(taken(tmp_path / "b", HERE)))
    settings = ClipSettings(
        size=(24, 24), multiples=(4,), recordings=1, scenes=0, photographs=0, recording_folders=folders
    )
    assert coarser_by(settings) == (1,)
    check_fits(settings, 23)
    assert {recorded(settings, 0, number, 4).off_on.shape for number in range(6)} == {(2, 32, 24, 24)}
