"""What becomes of steps whose loss is not finite, of checkpoints that are torn, and of what a run keeps."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import pytest
import torch
from small_run import NETWORK, STEPS_OF_RUN, clips, kept, session
from tqdm import tqdm

from interp import weights
from interp.methods import METHODS
from interp.train import progress
from interp.train.checkpoints import WholeFiles, read_checkpoint
from interp.train.curves import read_curve
from interp.train.frame_fed import FrameFedLearner
from interp.train.learner import is_better, number_of
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.scores import Scores
from vid2ev.errors import DataError, UsageError


def test_steps_that_are_not_finite_change_nothing_and_are_counted(tmp_path: Path) -> None:
    # Samples 20 ... 27 are those of the sixth and seventh step of 4.
    before = session(tmp_path / "before", session_s=1e-9, batch=4, spoilt=range(0, 4))
    assert before.skipped == 1
    learnt = kept(tmp_path / "before")
    assert not any(name.endswith("exp_avg") for name in learnt)  # the optimiser knows of nothing
    done = session(tmp_path / "run", spoilt=range(20, 28))
    assert done.finished and done.skipped == 2
    assert all(bool(value.isfinite().all()) for value in kept(tmp_path / "run").values())
    assert float(read_curve(tmp_path / "run" / "training.csv")[-1]["skipped"]) == 2


@pytest.mark.parametrize("spoilt", [range(0, 4), range(8, 12)])  # the first step of 4, or the third
def test_the_loss_that_is_shown_is_of_steps_that_count(
    spoilt: range, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[str]()

    class Shown(tqdm):  # type: ignore[type-arg]
        def set_postfix_str(self, s: str = "", refresh: bool = True) -> None:
            said.append(s)

    monkeypatch.setattr(progress, "bar_of", lambda _, bar_format, **look: Shown(disable=True, **look))
    done = session(tmp_path / "run", spoilt=spoilt)
    assert done.skipped == 1 and len(said) == STEPS_OF_RUN
    unknown = [k for k, text in enumerate(said) if text.startswith("loss nan")]
    assert unknown == ([] if spoilt.start else [0])


def test_training_ends_where_nothing_is_finite_any_more(tmp_path: Path) -> None:
    with pytest.raises(
        DataError, match=r"no finite gradient in 3 steps in a row, up to step 6.*smaller rate than 0.0015"
    ):
        session(tmp_path / "run", spoilt=range(16, 1000), most_skipped=3)


def test_a_checkpoint_is_whole_or_the_one_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "checkpoint.ckpt"
    WholeFiles().save_checkpoint({"global_step": 1, "state_dict": {}}, path)

    def torn(content: object, file: object) -> None:
        file.write(b"half of it")  # type: ignore[attr-defined]
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(torch, "save", torn)
    with pytest.raises(DataError, match=r"No space left on device; make room"):
        WholeFiles().save_checkpoint({"global_step": 2}, path)
    assert read_checkpoint(path) == {"global_step": 1, "state_dict": {}}
    assert [child.name for child in tmp_path.iterdir()] == ["checkpoint.ckpt"]


def test_a_torn_or_damaged_checkpoint_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.ckpt"
    WholeFiles().save_checkpoint({"global_step": 1, "state_dict": {"a": torch.ones(1000)}}, path)
    whole = path.read_bytes()
    for length in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(DataError, match=r"checkpoint\.ckpt is no whole checkpoint .*; copy the run again") as error:
            read_checkpoint(path)
        assert "\n" not in str(error.value)
    middle = whole.index(torch.ones(1000).numpy().tobytes()) + 2000
    path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 4]) + whole[middle + 1 :])
    with pytest.raises(DataError, match=r"is no whole checkpoint \(Bad CRC-32 for file .*\); copy the run again"):
        read_checkpoint(path)
    torch.save({"weights": 1}, path)
    with pytest.raises(DataError, match="is no checkpoint of `vid2ev train`"):
        read_checkpoint(path)


def test_a_checkpoint_of_another_run_is_refused_in_a_sentence(tmp_path: Path) -> None:
    assert session(tmp_path / "run", stop=lambda: True).step == 1
    path = tmp_path / "run" / "checkpoint.ckpt"
    found = torch.load(path, weights_only=True)
    weights = dict(found["state_dict"])
    name = next(iter(weights))
    for changed, said in (
        ({"state_dict": weights | {name: weights[name][None]}}, "is of another network"),
        ({"state_dict": weights | {"more": weights[name]}}, "is of another network"),
        ({"state_dict": weights | {name: 3}}, "does not say what it should"),
        ({"best": [1, {"scenes": {"psnr": 30.0}}]}, "does not say what it should"),
    ):
        torch.save(found | changed, path)
        with pytest.raises(DataError, match=rf"checkpoint\.ckpt {said}") as error:
            session(tmp_path / "run", resume=True)
        assert "\n" not in str(error.value)


def test_a_run_keeps_all_that_it_has_to_show(tmp_path: Path) -> None:
    done = session(tmp_path / "run")
    assert done.scores["scenes"].keys() == {"network", *METHODS}
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    assert {"torch", "lightning", "vid2ev"} <= run["versions"].keys()
    assert [row["step"] for row in read_curve(tmp_path / "run" / "validation.csv")] == ["0", "6", f"{STEPS_OF_RUN}"]
    pictures = sorted((tmp_path / "run" / "pictures").iterdir())
    assert [path.name for path in pictures] == [f"step-{step:07d}-scenes.png" for step in (0, 6, STEPS_OF_RUN)]
    rows, columns, _ = cv2.imread(str(pictures[-1])).shape
    assert (rows, columns) == (2 * 16 + 2, 7 * 16 + 6 * 2)  # two targets; seven images with gaps of 2 px
    assert list((tmp_path / "run" / "tensorboard").glob("events.out.*"))
    assert str(tmp_path) not in (tmp_path / "run" / "run.json").read_text()


def test_the_weights_are_the_running_mean_where_it_was_best(tmp_path: Path) -> None:
    # The first run gets better, so that its last weights are kept; the other is spoilt by its rate and keeps its first.
    for folder, rate, best in ((tmp_path / "slow", 1e-4, STEPS_OF_RUN), (tmp_path / "fast", 30.0, 0)):
        done = session(folder, rate=rate, clip=100.0)
        rows = {int(row["step"]): row for row in read_curve(folder / "validation.csv")}
        assert done.best == best == max(rows, key=lambda step: float(rows[step]["scenes.psnr"]))
        assert done.scores["scenes"]["network"].psnr == pytest.approx(float(rows[best]["scenes.psnr"]), abs=1e-3)
        network = weights.load(folder / "weights.safetensors")
        again = [one for _, clip in clips() for one in of_clip(network, clip)]
        assert Scores.mean(again) == done.scores["scenes"]["network"]
        mean = kept(folder)
        same = [torch.equal(value, mean[f"network.{name}"]) for name, value in network.state_dict().items()]
        assert all(same) == (best == STEPS_OF_RUN)
        assert any(not torch.equal(mean[f"network.{n}"], mean[f"current.network.{n}"]) for n in network.state_dict())


@pytest.mark.parametrize("without", [1, 2])
def test_a_group_without_a_number_decides_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, without: int
) -> None:
    """As clips of HDR light in which nothing lies beyond the range of the frames."""
    real, numbers = FrameFedLearner.scored, [clip["truth"] for _, clip in clips(groups=2)[without:]]
    nothing = Scores(math.nan, 0.5, math.nan, math.nan)

    def scored(self: FrameFedLearner, clip: dict[str, torch.Tensor], images: torch.Tensor) -> list[Scores]:
        found = real(self, clip, images)
        return found if any(torch.equal(clip["truth"], truth) for truth in numbers) else [nothing] * len(found)

    monkeypatch.setattr(FrameFedLearner, "scored", scored)
    options = {"rate": 1e-4, "clip": 100.0, "groups": 2}
    if without == 1:
        assert session(tmp_path / "run", **options).best == STEPS_OF_RUN
    else:
        with pytest.raises(DataError, match=r"clips to validate with \(.*\) have nothing to score"):
            session(tmp_path / "run", **options)


def test_a_validation_that_loses_a_number_is_not_the_best() -> None:
    one, better, none = (Scores(psnr, 0.9, psnr, psnr) for psnr in (20.0, 30.0, math.nan))
    assert is_better({"a": better, "b": none}, {"a": one, "b": none})
    assert not is_better({"a": better, "b": none}, {"a": one, "b": one})
    assert is_better({"a": one, "b": one}, {}) and not is_better({"a": one}, {"a": one})


def of_clip(network: torch.nn.Module, clip: dict[str, torch.Tensor]) -> list[Scores]:
    """Scores of a network on a clip."""
    learner = FrameFedLearner(NETWORK, network, Recipe(), Schedule(0, 0.0))  # type: ignore[arg-type]
    with torch.no_grad():
        return learner.scored(clip, learner.predicted(clip).float())


def test_a_folder_is_taken_once(tmp_path: Path) -> None:
    session(tmp_path / "run", session_s=1e-9)
    with pytest.raises(UsageError, match=r"holds a run; --resume goes on"):
        session(tmp_path / "run")
    with pytest.raises(UsageError, match=r"was begun with recipe\.rate = 0\.0015, not 0\.001"):
        session(tmp_path / "run", resume=True, rate=0.001)
    with pytest.raises(UsageError, match=r"begun with|holds no run") as error:
        session(tmp_path / "nothing", resume=True)
    assert not (tmp_path / "nothing").exists(), error
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(UsageError, match="holds files that are no run"):
        session(tmp_path / "mine")


def test_random_numbers_are_of_seed_step_and_process() -> None:
    numbers = {number_of(seed, step, rank) for seed in range(4) for step in range(50) for rank in range(4)}
    assert len(numbers) == 4 * 50 * 4
    assert all(0 <= number < 1 << 63 for number in numbers)
    assert clips()[0][1]["frames"].shape == (1, 2, 3, 16, 16)
