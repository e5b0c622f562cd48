"""An evaluation that was interrupted goes on to the same bytes, and only with the same settings."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import torch
from footage_made import pictures, write_film, write_hsergb, write_predictions
from render_pools import pools_begun
from rows_read import read_rows

from interp.evaluate import run
from interp.evaluate.kept import KeptRows
from interp.evaluate.protocol import Protocol
from interp.evaluate.run import evaluate
from interp.evaluate.simulated import Simulated
from interp.networks import make
from interp.weights import save
from vid2ev import DataError, UsageError
from vid2ev.cluster import workers as cluster_workers
from vid2ev.cluster.task import Task
from vid2ev.cluster.work import Outcome, outcomes
from vid2ev.cluster.workers import Workers
from vid2ev.recording.exposures import write_codes

pytestmark = pytest.mark.long

BASELINES = ("linear", "bridge")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("eval")
    for seed, name in enumerate("ab"):
        write_hsergb(folder / "data" / name, pictures(14, seed))
    write_film(folder / "film.npz", pictures(14))
    save(folder / "firenet.safetensors", "firenet", make("firenet", "tiny"))
    write_predictions(folder / "theirs" / "a", pictures(14, 5))
    write_codes(folder / "theirs" / "a" / "frame1.png", pictures(1)[0, :12])  # of the first group
    return folder


def options(data: Path) -> dict[str, Any]:
    networks, predictions = [data / "firenet.safetensors"], [data / "theirs"]
    return {
        "baselines": BASELINES, "protocol": Protocol(3, 3), "networks": networks, "predictions": predictions,
    }  # fmt: skip


def datasets(data: Path) -> list[str]:
    return [str(data / "data"), str(data / "film.npz")]


@pytest.fixture(scope="module")
def whole(data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole") / "report"
    evaluate(datasets(data), folder, **options(data))
    assert not (folder / "lock").exists()
    return contents(folder)


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("stop", [1, 4, 8])
def test_what_was_interrupted_goes_on_to_the_same_bytes(
    data: Path, whole: dict[str, bytes], stop: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[int] = []

    def interrupted(*_: Any) -> None:
        said.append(1)
        if len(said) > stop:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(datasets(data), tmp_path / "report", report=interrupted, **options(data))
    assert not {"rows.csv", "report.md", "report.html"} & set(contents(tmp_path / "report"))
    torn = sorted((tmp_path / "report").rglob("*.jsonl"))[-1]
    torn.write_bytes(torn.read_bytes() + b'{"group": 7, "ro')  # as of a kill while it was written
    rebuilt: list[str] = []
    rows_of = run.rows_of
    monkeypatch.setattr(run, "rows_of", lambda *asked: rebuilt.append(asked[1]) or rows_of(*asked))
    evaluate(datasets(data), tmp_path / "report", resume=True, **options(data))
    assert contents(tmp_path / "report") == whole
    assert len(rebuilt) == 4 * (9 - stop)  # nothing is scored twice


@pytest.mark.parametrize(("jobs", "pools"), [(1, {4}), (2, {2}), (4, set())])
def test_a_worker_renders_scenes_by_its_share_of_the_cores(
    jobs: int, pools: set[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = pools_begun(monkeypatch, 4, cluster_workers)

    def here(tasks: Sequence[Task], _: Workers) -> Iterator[Outcome]:
        return (Outcome(task.name, task.call(lambda _: None)) for task in tasks)

    sources = ["scene:flicker,size=128x96,scene.duration_s=0.04"]
    evaluate(sources, tmp_path, baselines=["nearest"], limit=1, workers=Workers(jobs), share=here)
    assert begun == pools


def test_workers_change_no_byte(data: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    shares: list[float] = []

    def share(tasks: Sequence[Task], workers: Workers) -> Iterator[Outcome]:
        return outcomes(tasks, workers, lambda _, facts: shares.append(facts.get("share", 0.0)))

    evaluate(datasets(data), tmp_path / "report", workers=Workers(jobs=2, retries=0), share=share, **options(data))
    assert contents(tmp_path / "report") == whole and shares and all(0 <= share <= 1 for share in shares)


def test_a_finished_evaluation_is_left_as_it_is(
    data: Path, whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    evaluate(datasets(data), tmp_path / "report", **options(data))
    monkeypatch.setattr(run, "rows_of", None)
    found = evaluate(datasets(data), tmp_path / "report", resume=True, **options(data))
    assert contents(tmp_path / "report") == whole
    assert repr(read_rows(tmp_path / "report" / "rows.csv")) == repr(found.rows)  # (NaN is not equal to itself)


def test_a_full_disk_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    kept = KeptRows(tmp_path)
    for write in (lambda: kept.add("a", "bridge", 0, []), lambda: kept.finish("a", {})):
        with pytest.raises(DataError, match=r"No space left on device; make room or access there, then --resume$"):
            write()


@pytest.mark.parametrize("jobs", [1, 2])
def test_rows_that_were_removed_are_made_again(data: Path, whole: dict[str, bytes], tmp_path: Path, jobs: int) -> None:
    """As whoever finds them damaged is told to have them made."""
    evaluate(datasets(data), tmp_path / "report", **options(data))
    (tmp_path / "report" / "kept" / "a" / "bridge.jsonl").unlink()
    for name in ("a/theirs", "b/firenet"):
        rows = tmp_path / "report" / "kept" / f"{name}.jsonl"
        rows.write_bytes(rows.read_bytes()[:-1])
    more: dict[str, Any] = {"workers": Workers(jobs, retries=0), "share": outcomes} if jobs > 1 else {}
    evaluate(datasets(data), tmp_path / "report", resume=True, **options(data), **more)
    assert contents(tmp_path / "report") == whole


@pytest.mark.parametrize(("gone", "jobs"), [("worst", 1), ("worst/firenet", 2), ("worst/linear/b_*_made.png", 1)])
def test_pictures_of_the_worst_frames_that_were_removed_are_made_again(
    data: Path, whole: dict[str, bytes], tmp_path: Path, gone: str, jobs: int
) -> None:
    evaluate(datasets(data), tmp_path / "report", **options(data))
    removed = [*(tmp_path / "report").glob(gone)]
    for path in removed:
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    more: dict[str, Any] = {"workers": Workers(jobs, retries=0), "share": outcomes} if jobs > 1 else {}
    evaluate(datasets(data), tmp_path / "report", resume=True, **options(data), **more)
    assert removed and contents(tmp_path / "report") == whole


def test_methods_can_be_added_and_other_settings_are_refused(
    data: Path, whole: dict[str, bytes], tmp_path: Path
) -> None:
    first = options(data) | {"networks": []}
    evaluate(datasets(data), tmp_path / "report", **first)
    evaluate(datasets(data), tmp_path / "report", resume=True, **options(data))
    later = contents(tmp_path / "report")
    for name in ("rows.csv", "summary.json", "report.md", "report.html"):
        assert later[name] == whole[name]
    with pytest.raises(UsageError, match="--resume goes on"):
        evaluate(datasets(data), tmp_path / "report", **options(data))
    with pytest.raises(UsageError, match=r"begun with protocol.skip = 3, not 6"):
        other = options(data) | {"protocol": Protocol(6, 6)}
        evaluate(datasets(data), tmp_path / "report", resume=True, **other)
    with pytest.raises(UsageError, match=r"begun with sequences.film"):
        evaluate(datasets(data)[:1], tmp_path / "report", resume=True, **options(data))
    save(tmp_path / "firenet.safetensors", "firenet", make("firenet", "tiny"))
    with pytest.raises(UsageError, match=r"begun with methods.firenet.weights_sha256"):
        changed = options(data) | {"networks": [tmp_path / "firenet.safetensors"]}
        evaluate(datasets(data), tmp_path / "report", resume=True, **changed)


@pytest.mark.parametrize("within", ["seq", "pictures", "theirs"])
def test_a_report_may_lie_in_what_it_is_made_of(tmp_path: Path, within: str) -> None:
    write_hsergb(tmp_path / "seq", pictures(5))
    write_predictions(tmp_path / "pictures", pictures(5))
    write_predictions(tmp_path / "theirs" / "seq", pictures(5))
    asked = [str(tmp_path / name) for name in ("seq", "pictures")], tmp_path / within / "report"
    more: dict[str, Any] = {"protocol": Protocol(3, 3), "simulated": Simulated.of("clean", fps=250)}
    more["predictions"] = [tmp_path / "theirs"]
    first = evaluate(*asked, baselines=["linear"], **more)
    rows = evaluate(*asked, baselines=["linear", "nearest"], resume=True, **more).rows
    assert repr([row for row in rows if row.method != "nearest"]) == repr(first.rows)


def test_pictures_of_another_method_may_come_to_lie_beside_those_that_were_scored(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "x", pictures(5))
    places: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"], "protocol": Protocol(3, 3)}
    for name in ("ours", "yours"):
        write_predictions(tmp_path / "theirs" / "x" / name, pictures(5))
        found = evaluate([str(tmp_path / "x")], tmp_path / "report", resume=name == "yours", **places)
    assert [of["perfect"] for of in found.summary["methods"].values()] == [3, 3]
    write_codes(tmp_path / "theirs" / "x" / "ours" / "1.png", pictures(5)[0])
    with pytest.raises(UsageError, match=r"was begun with methods\.ours"):
        evaluate([str(tmp_path / "x")], tmp_path / "report", resume=True, **places)


def test_names_and_folders_that_are_taken_are_refused(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").write_text("mine")
    with pytest.raises(UsageError, match="holds something else"):
        evaluate(datasets(data), tmp_path / "taken", **options(data))
    with pytest.raises(UsageError, match="nothing to score"):
        evaluate(datasets(data), tmp_path / "report", baselines=())
    with pytest.raises(UsageError, match="did you mean bridge"):
        evaluate(datasets(data), tmp_path / "report", baselines=["brigde"])
    with pytest.raises(UsageError, match="device 'gpu': expected cpu or cuda"):
        evaluate(datasets(data), tmp_path / "report", device="gpu")
    with pytest.raises(UsageError, match="torch sees no GPU"), monkeypatch.context() as patch:
        patch.setattr(torch.cuda, "is_available", lambda: False)
        evaluate(datasets(data), tmp_path / "report", device="cuda")
    with pytest.raises(UsageError, match="GPUs up to cuda:1 here"), monkeypatch.context() as patch:
        patch.setattr(torch.cuda, "is_available", lambda: True)
        patch.setattr(torch.cuda, "device_count", lambda: 2)
        evaluate(datasets(data), tmp_path / "report", device="cuda:2")
    with pytest.raises(DataError, match="no frame could be scored"):
        evaluate(datasets(data), tmp_path / "report", baselines=["linear"], protocol=Protocol(20, 20))
