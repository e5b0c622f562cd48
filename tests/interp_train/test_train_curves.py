"""Curves as CSV: kept up to where training goes on, whole rows only."""

from __future__ import annotations

from pathlib import Path

import pytest

from interp.train import runs
from interp.train.curves import Curves, read_curve
from interp.train.job import Job
from interp.train.machines import Machines
from interp.train.run_folder import RunFolder
from vid2ev.errors import DataError


def log(curves: Curves, *steps: int) -> None:
    for step in steps:
        curves.log_metrics({"train/loss": 1 / step, "validation/psnr": 10.0 * step, "epoch": 0}, step)


def test_rows_beyond_the_checkpoint_are_forgotten(tmp_path: Path) -> None:
    log(Curves(tmp_path), 1, 2, 3)
    again = Curves(tmp_path, step=2)
    assert [row["step"] for row in read_curve(tmp_path / "training.csv")] == ["1", "2"]
    log(again, 3)
    assert read_curve(tmp_path / "training.csv")[-1] == {"step": "3", "loss": "0.333333"}
    assert [row["psnr"] for row in read_curve(tmp_path / "validation.csv")] == ["10", "20", "30"]


def test_a_row_cut_off_by_a_crash_is_dropped(tmp_path: Path) -> None:
    log(Curves(tmp_path), 1, 2)
    whole = (tmp_path / "training.csv").read_bytes()
    for length in range(whole.rindex(b"\n", 0, -1) + 2, len(whole)):
        (tmp_path / "training.csv").write_bytes(whole[:length])
        assert [row["step"] for row in read_curve(tmp_path / "training.csv")] == ["1"]
    log(Curves(tmp_path, step=1), 2)
    assert [row["step"] for row in read_curve(tmp_path / "training.csv")] == ["1", "2"]


@pytest.mark.parametrize("zeros", [b"", bytes(100), bytes(50) + b"\n" + bytes(50), b"\n"])
def test_a_curve_that_a_crash_left_without_content_is_begun_anew(tmp_path: Path, zeros: bytes) -> None:
    (tmp_path / "training.csv").write_bytes(zeros)
    log(Curves(tmp_path, step=1), 2)
    assert [row["step"] for row in read_curve(tmp_path / "training.csv")] == ["2"]


def test_zeros_in_place_of_rows_are_dropped(tmp_path: Path) -> None:
    log(Curves(tmp_path), 1, 2)
    whole = (tmp_path / "training.csv").read_bytes()
    (tmp_path / "training.csv").write_bytes(whole + bytes(20) + b"\n3,0.1\n")
    log(Curves(tmp_path, step=5), 6)
    assert [row["step"] for row in read_curve(tmp_path / "training.csv")] == ["1", "2", "6"]


@pytest.mark.parametrize("name", ["training.csv", "validation.csv"])
@pytest.mark.parametrize(
    "content",
    [b"step,loss\none,0.5\n", b"loss\n0.5\n", b"step,loss\nnan,0.5\n", b"step,loss\n1\n", b"step,loss\n1,2,3\n",
     b"step,loss\n1,\xff\n", b"\xff\xfes\n1\n", b"step;loss\n1;0,5\n", b"step,loss\n1," + b"5" * 200_000 + b"\n"],
)  # fmt: skip
def test_a_damaged_curve_is_one_sentence_and_stays_as_it_is(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=rf"{name} cannot be read as a curve: .*; put it right, or remove it"):
        Curves(tmp_path, step=5)
    assert (tmp_path / name).read_bytes() == content


@pytest.mark.parametrize("rows", [0, 1])  # a file is made for the first; others are added to it
def test_a_row_that_the_disk_does_not_take_is_one_sentence(
    rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    curves = Curves(tmp_path)
    log(curves, *range(1, rows + 1))
    monkeypatch.setattr("os.fsync", full)
    monkeypatch.setattr("csv.DictWriter.writerow", full)
    with pytest.raises(DataError, match=r"training\.csv cannot be written: No space left on device; make room"):
        log(curves, rows + 1)
    assert len(read_curve(tmp_path / "training.csv")) == rows


def test_columns_may_come_later(tmp_path: Path) -> None:
    curves = Curves(tmp_path)
    log(curves, 1)
    curves.log_metrics({"train/loss": 2.0, "train/skipped": 1.0}, 2)
    curves.log_metrics({"train/loss": 3.0}, 3)
    rows = read_curve(tmp_path / "training.csv")
    assert [row["skipped"] for row in rows] == ["", "1", ""]


def test_a_new_run_has_no_curves(tmp_path: Path) -> None:
    Curves(tmp_path)
    assert read_curve(tmp_path / "training.csv") == []
    assert not list(tmp_path.iterdir())


def test_validation_that_is_measured_again_has_one_row(tmp_path: Path) -> None:
    for psnr in (20.0, 21.0):
        curves = Curves(tmp_path, 7)
        curves.log_metrics({"validation/psnr": psnr}, 7)
        curves.log_metrics({"train/loss": 1.0}, 7)
    assert [(row["step"], row["psnr"]) for row in read_curve(tmp_path / "validation.csv")] == [("7", "21")]
    assert len(read_curve(tmp_path / "training.csv")) == 2


@pytest.mark.parametrize("name", ["training.csv", "validation.csv"])
def test_a_damaged_curve_is_found_before_clips_are_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    job = Job.of("rrin", "tiny", settings=["batch=2"])
    RunFolder(tmp_path / "run", job.kept(), resume=False).close()
    (tmp_path / "run" / name).write_text("step,loss\none,0.5\n")
    monkeypatch.setattr(runs, "feed_of", lambda *_: pytest.fail("clips are made"))
    with pytest.raises(DataError, match=f"{name} cannot be read as a curve"):
        runs.run(job, tmp_path / "run", resume=True, machines=Machines(1, accelerator="cpu"))
