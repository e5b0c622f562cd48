"""Curves as CSV: kept up to where training goes on, whole rows only."""

from __future__ import annotations

from pathlib import Path

from interp.train.curves import Curves, read_curve


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
