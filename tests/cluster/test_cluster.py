"""Work that is shared out: every task has its outcome, whatever happens to files, workers and memory."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest
import shared_tasks as made

from vid2ev import UsageError, convert
from vid2ev.cluster import workers as workers_module
from vid2ev.cluster.task import Task
from vid2ev.cluster.work import Outcome, outcomes
from vid2ev.cluster.workers import Workers

CLIP = "synthetic:moving-edge,size=32x24,fps=100,duration_s=0.3"
QUICK: dict[str, Any] = {"upsample": "none", "preview": False, "threads": 1, "piece": 1}


def all_of(tasks: list[Task], workers: Workers, **watch: Any) -> dict[str, Outcome]:
    found = {outcome.name: outcome for outcome in outcomes(tasks, workers, **watch)}
    assert set(found) == {task.name for task in tasks}
    return found


def begun(name: str) -> int:
    return len(list(Path().glob(f"{name}.*")))


def test_all_tasks_have_an_outcome_whatever_some_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = ("fails_once", "always_fails", "is_refused", "is_mistaken", "dies_once")
    tasks = [Task(name, getattr(made, name)) for name in names]
    tasks += [Task(f"clip {k}", partial(made.waits, name=f"made {k}", seconds=0.05)) for k in range(4)]
    tasks.append(Task("clip", partial(made.converts_and_dies_once, clip=CLIP, directory=Path("killed"), options=QUICK)))
    told: list[tuple[str, dict[str, Any]]] = []
    found = all_of(tasks, Workers(jobs=2), watch=lambda name, facts: told.append((name, dict(facts))))
    assert [found[f"clip {k}"].value for k in range(4)] == [f"made {k}" for k in range(4)]
    # (Three times, if a worker that held the result died before it was fetched.)
    assert {found["fails_once"].value, found["dies_once"].value} <= {2, 3}
    assert str(found["always_fails"].error) == "the file is broken" and begun("always_fails") == 3
    assert isinstance(found["is_refused"].error, UsageError) and begun("is_refused") == 1
    assert isinstance(found["is_mistaken"].error, ZeroDivisionError)
    assert {name for name, facts in told if facts.get("begun")} == {task.name for task in tasks}
    assert [facts["events"] for name, facts in told if name == "clip 3" and "events" in facts] == [7]
    # A conversion that was killed went on from its checkpoint, to the bytes of one that was not.
    convert(CLIP, "whole", **QUICK)
    assert 0 < found["clip"].value < 30
    assert Path("killed/events.h5").read_bytes() == Path("whole/events.h5").read_bytes()


def test_a_task_that_takes_too_much_memory_is_named_and_the_others_are_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tasks = [Task("greedy", made.takes_all_memory)]
    tasks += [Task(f"clip {k}", partial(made.waits, name=f"made {k}", seconds=0.3)) for k in range(3)]
    found = all_of(tasks, Workers(jobs=2, retries=1, memory="450MiB"))
    assert [found[f"clip {k}"].value for k in range(3)] == [f"made {k}" for k in range(3)]
    assert "greedy ran out of memory: its worker was ended 2 times" in str(found["greedy"].error)
    assert begun("takes_all_memory") == 2


def test_what_cannot_be_meant_is_said_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        pytest.raises(UsageError, match="--memory much: expected a size such as 4GiB"),
        Workers(2, memory="much").client(),
    ):
        pass
    with pytest.raises(UsageError, match="expected an address such as"), Workers(scheduler="nowhere").client():
        pass
    monkeypatch.setattr(workers_module, "REACHED_S", 1)
    with pytest.raises(OSError, match="no Dask scheduler answers"), Workers(scheduler="tcp://127.0.0.1:9").client():
        pass
    monkeypatch.setattr(workers_module, "has_dask", lambda: False)
    with pytest.raises(UsageError, match=r"pip install 'vid2ev\[cluster\]'"), Workers(2).client():
        pass
