"""Clips that are made on a GPU, here a simulated one, are those of the CPU; a process of its own makes them ahead."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from test_layout_quirks import written

from interp.data.ahead import Ahead
from interp.data.clip import read_clip
from interp.data.layer_kernel import lay
from interp.data.layer_tensors import Laid, seen
from interp.data.making import made
from interp.data.on_card import made_on_card
from interp.data.pool import AHEAD, Pool
from interp.data.samples import Samples, SampleSettings
from interp.data.sensor_ranges import SENSORS
from interp.data.settings import ClipSettings
from vid2ev.errors import DataError
from vid2ev.sensors.devices import Device

DEMO = Path(__file__).parents[2] / "examples" / "demo.mp4"
SIMULATED = Device("simulated")
LITTLE = ClipSettings(size=(16, 16), multiples=(4,), bins=8, scenes=0.0, sensors=SENSORS["noisy"])


@pytest.mark.long
@pytest.mark.parametrize(
    "said",
    [
        {"rigs": 1.0, "coarser": (1, 2)},
        {"scenes": 1.0, "photographs": 0.0, "scene_names": ("spinning-shapes",), "rigs": 0.5, "coarser": (1,)},
        {"videos": 1.0, "photographs": 0.0, "video_files": (str(DEMO),)},
        {"light": "linear"},
    ],
    ids=["photographs", "scenes", "videos", "linear"],
)
def test_clips_of_a_card_are_those_of_the_cpu(said: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the last bits of the light, and with it of the aperture: hardly a code or event is another."""
    monkeypatch.setattr("interp.data.on_card.FRAMES", 3)
    clips = ClipSettings.model_validate(LITTLE.model_dump() | said)
    got = dict(made_on_card(clips, 5, [1, 0], SIMULATED))
    assert sorted(got) == [0, 1]
    for number, ours in got.items():
        theirs = made(clips, 5, number)
        for name in ("truth", "keys", "off_on"):
            one, other = getattr(ours, name), getattr(theirs, name)
            assert one.dtype == other.dtype and one.shape == other.shape
            np.testing.assert_allclose(one.astype(float), other.astype(float), rtol=1e-3, atol=1.01)
            # (what an event behind a dead time counts for hangs on all others, which hardly ever are others: not whole)
            shared = 0.02 if name == "off_on" else 0.0
            same = np.isclose(one.astype(float), other.astype(float), rtol=shared, atol=0)
            assert (~same).mean() < 2e-3
        assert (ours.contrast, ours.gap_us) == (theirs.contrast, theirs.gap_us)
        assert ours.about == theirs.about | {"gain": pytest.approx(theirs.about["gain"], rel=1e-6)}
    assert sum(int(clip.off_on.sum(dtype=float)) for clip in got.values()) > 200


places = st.tuples(st.floats(-40, 60), st.floats(-40, 60), st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))
waves = st.tuples(st.floats(0, 3), st.floats(2, 40), st.floats(0, 1))


@settings(max_examples=40)
@given(
    st.lists(st.tuples(places, waves), min_size=1, max_size=3), st.booleans(), st.integers(1, 20), st.integers(1, 20)
)
def test_layers_of_tensors_are_those_of_the_kernel(moments, mirrored, rows, columns):
    draw = np.random.default_rng(rows + 100 * columns)
    behind, layer = draw.random((9, 7, 4), np.float32), draw.random((rows, columns, 4), np.float32)
    behind[..., 3] = 1
    place, wave = (np.array([each[k] for each in moments]) for k in range(2))
    still = np.tile([3.0, 4.0, 1.0, 0.0], (len(moments), 1)), np.tile([0.0, 5.0, 0.0], (len(moments), 1))
    ours = seen(
        [
            Laid(torch.from_numpy(pixels), torch.from_numpy(at), torch.from_numpy(by), goes_on)
            for pixels, (at, by), goes_on in ((behind, still, True), (layer, (place, wave), mirrored))
        ],
        (11, 6),
    )
    for k in range(len(moments)):
        theirs = np.zeros((6, 11, 3), np.float32)
        lay(behind, tuple(still[0][k]), tuple(still[1][k]), True, theirs)
        lay(layer, tuple(place[k]), tuple(wave[k]), mirrored, theirs)
        # (a place is rounded to float64 in another order: a spline moves by 1e-6 where rays are 1e9 pixels long)
        np.testing.assert_allclose(ours[k].numpy(), theirs, rtol=0, atol=2e-6)


def test_many_pictures_are_laid_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    layer = torch.rand(8, 8, 4)
    place = torch.rand(5, 4, dtype=torch.float64)
    laid = Laid(layer, place, torch.ones(5, 3, dtype=torch.float64), True)
    whole = seen([laid], (6, 5))
    monkeypatch.setattr("interp.data.layer_tensors.AT_A_TIME", 60)
    assert torch.equal(seen([laid], (6, 5)), whole)


def pool_of_recordings(folder: Path, **window: float) -> Pool:
    """A pool whose clips need no card, though it has one."""
    written(folder / "seq", images=12)
    clips = ClipSettings(
        size=(16, 16), multiples=(4,), bins=8, recordings=1, scenes=0, photographs=0,
        recording_folders=(str(folder / "seq"),),
    )  # fmt: skip
    return Pool(folder / "clips", clips, 7, device=SIMULATED, **window)  # type: ignore[arg-type]


@pytest.mark.long
def test_clips_are_made_ahead_of_samples(tmp_path: Path) -> None:
    pool = pool_of_recordings(tmp_path, begin=2, most=4, fresh=1.0)
    samples, told = Samples(pool, SampleSettings(size=16), 10**6), []
    ahead = Ahead(pool, 0)
    try:
        ahead.fill(0, lambda done, of: told.append((done, of)))
        assert told == [(k, 2 + AHEAD) for k in range(1, 3 + AHEAD)]
        samples[3 * AHEAD]  # (makes what it needs by itself, and nothing for later)
        assert len(pool.missing(3 * AHEAD, 10 * AHEAD)) >= 10 * AHEAD
        ahead.reached(3 * AHEAD)
        until = time.monotonic() + 60
        while pool.missing(3 * AHEAD) and time.monotonic() < until:
            time.sleep(0.05)
        assert not pool.missing(3 * AHEAD)
    finally:
        ahead.close()
    kept, wanted = read_clip(pool.folder / "000003.npy"), made(pool.settings, 7, 3)
    np.testing.assert_array_equal(kept.off_on, wanted.off_on)
    assert not list(pool.folder.glob("*.new"))


@pytest.mark.long
@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM])
def test_who_makes_clips_ends_when_the_process_that_trains_says_so(tmp_path: Path, asked: signal.Signals) -> None:
    """Not where all processes are asked to: training ends after the step, for which there are to be clips."""
    pool = pool_of_recordings(tmp_path, begin=1, most=1, fresh=0.0)
    ahead = Ahead(pool, 0)
    ahead.fill(0)
    assert ahead._process.pid
    os.kill(ahead._process.pid, asked)
    ahead._process.join(1.0)
    ahead.reached(1)
    ahead.close()
    assert ahead._process.exitcode == 0


@pytest.mark.long
def test_who_makes_clips_and_ends_is_told_of(tmp_path: Path) -> None:
    pool = pool_of_recordings(tmp_path, begin=1, most=1, fresh=0.0)
    ahead = Ahead(pool, 0)
    assert ahead._process.pid
    os.kill(ahead._process.pid, signal.SIGKILL)
    ahead._process.join()
    with pytest.raises(DataError, match=r"clips cannot be made on the GPU \(exit code -9\).*--clips-on cpu"):
        ahead.reached(0)
    ahead.close()
    for file in (tmp_path / "seq" / "images_corrected").glob("*.png"):
        file.write_bytes(b"no picture")
    failing = Ahead(pool, 0)
    with pytest.raises(DataError, match=r"clips cannot be made on the GPU \(no window of 5 frames .*no picture"):
        failing.fill(0)
    failing.close()
