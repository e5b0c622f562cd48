"""The pool is a cache of a pure function: samples are the same for any number of workers, whatever was killed when."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from interp.data.clip import read_clip, write_clip
from interp.data.making import made, wanted
from interp.data.pool import AHEAD, KEPT, Pool
from interp.data.samples import Samples, SampleSettings
from interp.data.sensor_ranges import SENSORS
from interp.data.sequences import Sequences
from interp.data.settings import ClipSettings
from interp.train.job import Window
from vid2ev.errors import DataError, UsageError

pytestmark = pytest.mark.long

TINY = ClipSettings(size=(32, 32), scenes=0.0, photographs=1.0, sensors=SENSORS["clean"])
SMALL = SampleSettings(size=24)


def pool(folder: Path, settings: ClipSettings = TINY, **window: float) -> Pool:
    return Pool(folder, settings, 7, **({"begin": 4, "most": 8, "fresh": 0.5} | window))  # type: ignore[arg-type]


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[key], other[key]) for key in one)


def test_samples_are_those_of_any_number_of_workers(tmp_path: Path) -> None:
    alone = Samples(pool(tmp_path / "alone"), SMALL, 24)
    wanted = [alone[index] for index in range(24)]
    shared = Samples(pool(tmp_path / "shared"), SMALL, 24)
    loader = DataLoader(shared, batch_size=None, num_workers=2, multiprocessing_context="spawn")
    got = list(loader)
    assert all(same(one, other) for one, other in zip(wanted, got, strict=True))
    assert len({one["truth"].sum().item() for one in wanted}) > 20


def test_a_sample_does_not_depend_on_what_was_drawn_before(tmp_path: Path) -> None:
    forwards = Samples(pool(tmp_path / "a"), SMALL, 100)
    for index in range(10):
        forwards[index]
    assert same(forwards[60], Samples(pool(tmp_path / "b"), SMALL, 100)[60])
    assert same(forwards[3], Samples(pool(tmp_path / "c"), SMALL, 100)[3])


def test_the_window_slides_and_the_folder_stays_small(tmp_path: Path) -> None:
    clips = pool(tmp_path, begin=2, most=3, fresh=1.0)
    assert [clips.window(index) for index in (0, 1, 2, 10)] == [range(0, 2), range(0, 3), range(1, 4), range(9, 12)]
    samples = Samples(clips, SMALL, 10**6)
    clips.fill(0)
    for index in range(70):
        samples[index]
    there = sorted(int(path.stem) for path in clips.folder.glob("*.npy"))
    assert len(there) <= 3 + AHEAD + KEPT + 1
    assert {*clips.window(70)} <= {*there}  # (what is needed next was made in advance)


def test_filling_removes_what_an_earlier_run_has_left(tmp_path: Path) -> None:
    clips = pool(tmp_path, begin=1, most=1, fresh=1.0)
    clips.fill(0)
    (clips.folder / "999999.npy").write_bytes(b"of another time")
    reports: list[tuple[int, int]] = []
    clips.fill(5, report=lambda done, of: reports.append((done, of)))
    there = sorted(int(path.stem) for path in clips.folder.glob("*.npy"))
    assert there == [*range(5, 6 + AHEAD)]
    assert reports == [(k, 5) for k in range(1, 6)]


def test_processes_fill_a_pool_with_the_same_bytes(tmp_path: Path) -> None:
    clips, two = pool(tmp_path / "one", begin=4), pool(tmp_path / "two", begin=4)
    two.fill(0, jobs=2)
    for number in (0, 3, AHEAD):
        clips.clip(number)
        name = f"{number:06d}.npy"
        assert (clips.folder / name).read_bytes() == (two.folder / name).read_bytes()


def test_a_clip_that_cannot_be_made_is_not_waited_for(tmp_path: Path) -> None:
    """Of those that are queued, no process begins another."""
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"no film")
    films = TINY.model_copy(update={"photographs": 3.0, "videos": 1.0, "video_files": (str(broken),)})
    clips = pool(tmp_path / "clips", films, begin=40, most=40)
    shares = [wanted(clips.settings, 7, number).source for number in range(40 + AHEAD)]
    assert 0 < shares.index("videos") < 12
    with pytest.raises(DataError, match=r"broken\.mp4"):
        clips.fill(0, jobs=2)
    assert len(list(clips.folder.glob("*.npy"))) < 20


FILL = """
import sys
from pathlib import Path
from interp.data.pool import Pool
from interp.data.settings import ClipSettings
if __name__ == "__main__":
    pool = Pool(Path(sys.argv[1]), ClipSettings.model_validate_json(sys.argv[2]), 7, begin=4, most=8, fresh=0.5)
    pool.fill(0, report=lambda done, of: print(done, flush=True))
"""


def test_a_pool_that_was_killed_goes_on(tmp_path: Path) -> None:
    """However it is killed, each clip is there as a whole or not at all, and is the clip of its number."""
    arguments = [sys.executable, "-c", FILL, str(tmp_path), TINY.model_dump_json()]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        for _ in range(3):
            assert process.stdout.readline()
        time.sleep(0.01)  # (in the midst of another)
        os.kill(process.pid, signal.SIGKILL)
    clips = pool(tmp_path)
    there = sorted(clips.folder.glob("*.npy"))
    assert 3 <= len(there) < 4 + AHEAD
    for path in there:
        kept, wanted = read_clip(path), made(TINY, 7, int(path.stem))
        np.testing.assert_array_equal(kept.off_on, wanted.off_on)
        np.testing.assert_array_equal(kept.truth, wanted.truth)
        assert kept.about == wanted.about
    assert same(Samples(clips, SMALL, 9)[8], Samples(pool(tmp_path / "new"), SMALL, 9)[8])


def test_a_clip_goes_through_its_file_unchanged(tmp_path: Path) -> None:
    clip = made(TINY, 0, 0)
    write_clip(tmp_path / "clip.npy", clip)
    kept = read_clip(tmp_path / "clip.npy")
    for name in ("truth", "keys", "off_on"):
        np.testing.assert_array_equal(getattr(clip, name), getattr(kept, name))
        assert isinstance(getattr(kept, name), np.memmap)
    assert (kept.contrast, kept.gap_us, kept.about) == (clip.contrast, clip.gap_us, clip.about)
    assert [path.name for path in tmp_path.iterdir()] == ["clip.npy"]


@pytest.mark.parametrize("left", [0, 100, -1], ids=["nothing", "its beginning", "all but its end"])
def test_what_a_crash_of_the_machine_leaves_of_a_clip_is_made_again(tmp_path: Path, left: int) -> None:
    clips = pool(tmp_path, begin=1, most=1, fresh=0.0)
    clips.fill(0)
    whole = (clips.folder / "000000.npy").read_bytes()
    for number in (0, 7):
        (clips.folder / f"{number:06d}.npy").write_bytes(whole[:left])
    assert clips.clip(0).about == made(TINY, 7, 0).about
    assert (clips.folder / "000000.npy").read_bytes() == whole
    reports: list[tuple[int, int]] = []
    clips.fill(0, report=lambda done, of: reports.append((done, of)))
    assert reports == [(1, 1)]
    assert read_clip(clips.folder / "000007.npy").about == made(TINY, 7, 7).about


def test_what_killed_processes_were_writing_is_removed_and_nothing_else(tmp_path: Path) -> None:
    clips = pool(tmp_path)
    old, new, other = (clips.folder / f"000003.npy.{name}.new" for name in ("a" * 16, "b" * 16, "notes"))
    for path in (old, new, other):
        path.write_bytes(b"half")
    for path in (old, other):
        os.utime(path, (time.time() - 7200,) * 2)
    clips.remove_others(0)
    assert not old.exists() and new.exists() and other.exists()


@pytest.mark.parametrize("content", [b"", b"no clip", b"\x93NUMPY\x01\x00v\x00"])
def test_what_is_no_clip_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "000001.npy").write_bytes(content)
    with pytest.raises(DataError, match=r"000001\.npy is no clip"):
        read_clip(tmp_path / "000001.npy")


def test_a_disk_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(DataError, match="cannot be written"):
        pool(tmp_path / "file")


@pytest.mark.parametrize("window", [{"begin": 0}, {"begin": 9, "most": 8}, {"fresh": -1.0}])
def test_windows_that_cannot_be_are_refused(tmp_path: Path, window: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="expected 1 <= begin <= most"):
        pool(tmp_path, **window)


@pytest.mark.parametrize("wrong", [{"size": 48}, {"targets": 8}])
def test_samples_that_do_not_fit_are_refused(tmp_path: Path, wrong: dict[str, int]) -> None:
    with pytest.raises(UsageError):
        Samples(pool(tmp_path), SampleSettings(**({"size": 24} | wrong)), 5)


def test_the_window_says_what_disk_a_clip_takes(tmp_path: Path) -> None:
    """Of default settings: what a window of so many fills is to be known before hours of training."""
    write_clip(tmp_path / "0.npy", made(ClipSettings(scenes=0.0), 0, 0))
    said = f"{(tmp_path / '0.npy').stat().st_size / 1e6:.1f} MB"
    assert said in str(Window.model_fields["most"].description) and said in str(Pool.__doc__)


def test_samples_have_what_they_say(tmp_path: Path) -> None:
    samples = Samples(pool(tmp_path, fresh=0.0, begin=3), SampleSettings(size=24, targets=3), 40)
    for index in range(40):
        one = samples[index]
        assert one["frames"].shape == (2, 3, 24, 24) and one["truth"].shape == (3, 3, 24, 24)
        assert one["off_on"].shape == (2, 32, 24, 24) and one["off_on"].dtype == torch.float16
        assert one["truth"].min() >= 0 and one["truth"].max() <= 1
        times = one["times"] * 8
        assert torch.equal(times, times.round()) and (times.diff() > 0).all() and times[0] >= 1 and times[-1] <= 7
    with pytest.raises(IndexError):
        samples[40]


def test_counts_of_cameras_that_stand_elsewhere_lie_on_the_frames(tmp_path: Path) -> None:
    rigs = TINY.model_copy(update={"size": (36, 36), "rigs": 1.0, "coarser": (1, 2, 3)})
    samples = Samples(pool(tmp_path, rigs, fresh=0.0, begin=6), SMALL, 20)
    assert {samples.pool.clip(number).coarser for number in range(6)} >= {2, 3}
    for index in range(20):
        assert samples[index]["off_on"].shape == (2, 32, 24, 24)
        assert samples[index]["off_on"].dtype == torch.float16
        assert all(each.is_contiguous() for each in samples[index].values())


def test_sequences_of_hdr_light_are_clipped_as_the_paper_says(tmp_path: Path) -> None:
    linear = TINY.model_copy(update={"light": "linear"})
    sequences = Sequences(pool(tmp_path, linear, fresh=0.0, begin=3), SMALL, 12)
    for index in range(12):
        one = sequences[index]
        assert one["truth"].shape == one["clipped"].shape == (9, 3, 24, 24)
        # (as they come out of the memory that workers share: sums of networks go by the order of memory)
        assert all(each.is_contiguous() for each in one.values())
        codes = one["clipped"] * 1023
        assert (codes - codes.round()).abs().max() < 1e-3 and codes.min() >= 0 and codes.max() <= 1023
        # Where codes are in the midst of their range, light is a straight line of them: slope 15 to 60, noise 5.2 LSB.
        inside = (codes > 40) & (codes < 980)
        if inside.sum() > 2000:
            slope, _ = np.polyfit(codes[inside].numpy(), 65535 * one["truth"][inside].numpy(), 1)
            assert 14 < slope < 62  # (noise makes a fit a little flatter)
