"""A clip split by tiles: the recording put together has the bytes of one made at once."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev import UsageError, convert
from vid2ev.cluster.task import Task
from vid2ev.commands import main
from vid2ev.split import convert_split

FILES = ("events.h5", "preview.mp4", "noise_maps.npz")


def here(tasks: Sequence[Task]) -> None:
    """All tasks in this process, the last first."""
    for task in reversed(tasks):
        task.call(lambda _: None)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> str:
    """96x64 pixels, which are three blocks; some move, some rest, some are not finite, and there is a cut."""
    rng = np.random.default_rng(0)
    texture = np.exp(rng.normal(0, 0.4, (64, 140)))
    frames = np.stack([texture[:, 2 * k : 2 * k + 96] for k in range(12)])
    frames[:, :20] = 0.5
    frames[8:] = np.exp(rng.normal(0, 0.6, (64, 96)))
    frames[3, 40, 5] = np.nan
    path = tmp_path_factory.mktemp("split") / "clip.npy"
    np.save(path, frames.astype(np.float32))
    return str(path)


@pytest.mark.parametrize(
    "options",
    [
        {"sensor": "paper", "upsample": "flow", "subframes": 3},
        {"sensor": "v2e-noisy", "upsample": "none", "labels": True, "formats": "hdf5,csv"},
        {"sensor": "paper", "overrides": ("delay_us=700", "max_crossings=3"), "upsample": "linear", "subframes": 2},
    ],
    ids=str,
)
def test_tiles_together_have_the_bytes_of_the_whole(clip: str, tmp_path: Path, options: dict[str, Any]) -> None:
    options = {"fps": 50, "noise_maps": True, "threads": 1} | options
    whole = convert(clip, tmp_path / "whole", **options)
    made = convert_split(clip, tmp_path / "made", 3, here, **options)
    assert whole.pop("run") and made.pop("run") and made == whole and whole["counts"]["events"] > 10_000
    for name in (*FILES, *["events.csv"] * ("formats" in options)):
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert {path.name for path in tmp_path.iterdir()} == {"whole", "made"}
    again = convert_split(clip, tmp_path / "made", 3, here, resume=True, **options)
    again.pop("run")
    assert again == whole


def test_what_is_interrupted_anywhere_goes_on_to_the_same_bytes(clip: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "piece": 1}
    convert(clip, tmp_path / "whole", **options)

    def only_one(tasks: Sequence[Task]) -> None:
        tasks[1].call(lambda _: None)
        raise KeyboardInterrupt

    def interrupted(_: Any, done: Any) -> None:
        if done.frames == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", 2, only_one, **options)
    assert not (tmp_path / "made").exists()
    with pytest.raises(UsageError, match="--resume continues it"):
        convert_split(clip, tmp_path / "made", 2, here, **options)
    with pytest.raises(KeyboardInterrupt):
        convert_split(clip, tmp_path / "made", 2, here, resume=True, report=interrupted, **options)
    convert_split(clip, tmp_path / "made", 2, here, resume=True, **options)
    for name in FILES[:2]:
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert {path.name for path in tmp_path.iterdir()} == {"whole", "made"}


def test_two_event_cameras_are_split_alike(clip: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        '[[camera]]\nname = "left"\nkind = "dvs"\n[[camera]]\nname = "right"\nkind = "dvs"\nsize = [48, 32]\n'
    )
    options: dict[str, Any] = {"fps": 50, "upsample": "none", "threads": 1, "rig": rig, "preview": False}
    convert(clip, tmp_path / "whole", **options)
    convert_split(clip, tmp_path / "made", 2, here, **options)
    for name in ("left/events.h5", "right/events.h5"):
        assert (tmp_path / "made" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"effects": "auto"}, "cannot do --effects auto"),
        ({"frame_camera": True}, "cannot do a frame camera"),
        ({"probe": ["3,4"]}, "cannot do --probe"),
        ({"overrides": ["frame_rate_hz=1000"]}, "cannot do frame_rate_hz"),
    ],
    ids=str,
)
def test_what_cannot_be_split_is_refused(clip: str, tmp_path: Path, options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        convert_split(clip, tmp_path / "made", 2, here, fps=50, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_command_splits_among_its_workers(clip: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = [clip, "--fps", "50", "--upsample", "none", "--no-preview"]
    for wrong, sentence in (("tiles", "add --jobs or --scheduler"), ("time", "expected tiles")):
        result = CliRunner().invoke(main, ["convert", *options, "--split", wrong])
        assert result.exit_code == 2 and sentence in result.stderr
    assert CliRunner().invoke(main, ["convert", *options, "-o", "whole"]).exit_code == 0
    result = CliRunner().invoke(main, ["convert", *options, "-o", "made", "--jobs", "2", "--split", "tiles", "--json"])
    assert result.exit_code == 0 and json.loads(result.stdout)[0]["events"] > 0
    assert Path("made/events.h5").read_bytes() == Path("whole/events.h5").read_bytes()
