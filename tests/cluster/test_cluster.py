"""Work that is shared out: every task has its outcome, whatever happens to files, workers and memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import shared_tasks as made

from vid2ev import DataError, UsageError, convert
from vid2ev.cluster import workers as workers_module
from vid2ev.cluster.processes import processes
from vid2ev.cluster.task import Task, share_of
from vid2ev.cluster.work import Outcome, outcomes
from vid2ev.cluster.workers import Workers

pytestmark = pytest.mark.long

CLIP = "synthetic:moving-edge,size=32x24,fps=100,duration_s=0.3"
QUICK: dict[str, Any] = {"upsample": "none", "preview": False, "threads": 1, "piece": 1}


def all_of(tasks: list[Task], workers: Workers, **watch: Any) -> dict[str, Outcome]:
    found = {outcome.name: outcome for outcome in outcomes(tasks, workers, **watch)}
    assert set(found) == {task.name for task in tasks}
    return found


def begun(name: str) -> int:
    return len(list(Path().glob(f"{name}.*")))


@pytest.mark.parametrize("error", [KeyboardInterrupt, UsageError])
def test_processes_do_not_begin_what_is_queued_where_something_goes_wrong(
    tmp_path: Path, error: type[BaseException]
) -> None:
    with pytest.raises(error), processes(1) as submit:
        submit(os.mkdir, tmp_path / "first").result()
        submit(time.sleep, 0.5)
        for number in range(20):
            submit(os.mkdir, tmp_path / str(number))
        raise error
    assert (tmp_path / "first").exists() and len(list(tmp_path.iterdir())) < 5  # (a few are on their way already)


def test_control_c_of_all_processes_ends_them_at_once_and_only_one_says_so() -> None:
    program = """
from vid2ev.cluster.processes import processes
try:
    with processes(2) as submit:
        work = "import os, time; os.write(1, b'at work' + bytes([10])); time.sleep(1000)"  # (a line in one go)
        waiting = [submit(exec, work) for _ in range(6)]
        waiting[0].result()
except KeyboardInterrupt:
    print("interrupted")
"""
    child = subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        assert child.stdout and [child.stdout.readline() for _ in range(2)] == ["at work\n"] * 2
        os.killpg(child.pid, signal.SIGINT)  # (as a terminal does)
        assert child.communicate(timeout=60) == ("interrupted\n", "")
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)


def test_a_process_that_is_killed_is_one_sentence() -> None:
    with pytest.raises(DataError, match=r"want of memory as a rule; .* --resume"), processes(2) as submit:
        submit(os.kill, submit(os.getpid).result(), signal.SIGKILL).result()


def test_processes_end_with_the_program_even_if_that_is_killed() -> None:
    """At work and idle: both hold the program's output, and whoever reads that waits for them."""
    program = """
import os, time
from vid2ev.cluster.processes import processes
with processes(2) as submit:
    work = "import os, time; os.write(1, b'begun' + bytes([10])); time.sleep({})"
    done, at_work = (submit(exec, work.format(seconds)) for seconds in (1, 1000))
    done.result()
    print("idle", flush=True)
    at_work.result()
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, start_new_session=True) as parent:
        try:
            assert parent.stdout and [parent.stdout.readline() for _ in range(3)] == [b"begun\n", b"begun\n", b"idle\n"]
            parent.kill()
            assert parent.communicate(timeout=60) == (b"", None)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(parent.pid, signal.SIGKILL)


def test_a_task_that_fails_is_tried_again_but_not_one_that_cannot_be_meant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ("fails_once", "always_fails", "is_refused", "is_mistaken", "compiles")
    tasks = [Task(name, getattr(made, name)) for name in names]
    tasks.append(Task("clip", partial(made.waits, name="made", seconds=0.05)))
    told: list[tuple[str, dict[str, Any]]] = []
    found = all_of(tasks, Workers(jobs=1), watch=lambda name, facts: told.append((name, dict(facts))))
    assert found["clip"].value == "made" and found["fails_once"].value == 2
    assert str(found["always_fails"].error) == "the file is broken" and begun("always_fails") == 3
    assert isinstance(found["is_refused"].error, UsageError) and begun("is_refused") == 1
    assert isinstance(found["is_mistaken"].error, ZeroDivisionError)
    assert {name for name, facts in told if facts.get("begun")} == {task.name for task in tasks}
    assert [facts["events"] for name, facts in told if name == "clip" and "events" in facts] == [7]
    assert [facts["compiling"] for name, facts in told if name == "compiles" and "compiling" in facts] == [True, False]


@pytest.mark.parametrize("most", [16, 31])
def test_too_few_open_files_are_one_sentence_before_any_process_begins(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dask tries again and again."""
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (most, 1 << 20))
    monkeypatch.setattr("distributed.LocalCluster", None)
    with (
        pytest.raises(DataError, match=rf"^2 processes .* need 32 open files or more, and {most} may be; raise"),
        Workers(2).client(),
    ):
        pass


def test_a_worker_that_is_killed_costs_no_task_its_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tasks = [Task("dies_once", made.dies_once)]
    tasks += [Task(f"clip {k}", partial(made.waits, name=f"made {k}", seconds=0.05)) for k in range(4)]
    tasks.append(Task("clip", partial(made.converts_and_dies_once, clip=CLIP, directory=Path("killed"), options=QUICK)))
    found = all_of(tasks, Workers(jobs=2))
    assert [found[f"clip {k}"].value for k in range(4)] == [f"made {k}" for k in range(4)]
    assert found["dies_once"].value >= 2  # (more often, if its worker died with the result)
    # A conversion that was killed went on from its checkpoint, to the bytes of one that was not.
    convert(CLIP, "whole", **QUICK)
    assert found["clip"].error is None and found["clip"].value < 30
    assert Path("killed/events.h5").read_bytes() == Path("whole/events.h5").read_bytes()


def test_a_chain_goes_on_through_the_death_of_a_worker_to_the_bytes_of_one_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    clip = "synthetic:moving-edge,size=32x24,fps=100,duration_s=0.06"
    found = all_of(
        [Task("clip", partial(made.converts_in_links, clip=clip, directory=Path("linked"), options=QUICK))],
        Workers(jobs=1, retries=1),  # (fewer than there are links, each of which begins a task)
    )
    convert(clip, "whole", **QUICK)
    assert found["clip"].error is None and found["clip"].value > 4
    assert Path("linked/events.h5").read_bytes() == Path("whole/events.h5").read_bytes()


def test_a_result_that_dies_with_its_worker_is_made_again() -> None:
    coming = outcomes([Task("first", made.gives_its_process), Task("second", made.gives_its_process)], Workers(jobs=1))
    first = next(coming)
    time.sleep(1.0)  # (the second is done, too, and nobody has fetched it)
    os.kill(first.value, signal.SIGKILL)
    time.sleep(0.5)
    (second,) = coming
    assert second.error is None and second.value != first.value


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


@pytest.mark.parametrize("why", [OSError(24, "Too many open files"), PermissionError(13, "Permission denied")])
def test_where_no_processes_can_begin_it_is_said_why(why: OSError, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of those that have no shared memory: Dask says only that they do not, after what the system said."""

    def failing(**_: Any) -> None:
        try:
            try:
                raise why
            except OSError:
                raise AssertionError("Status.init")  # noqa: B904
        except AssertionError as error:
            raise RuntimeError("Nanny failed to start.") from error

    def lacking(*_: Any) -> None:
        raise why

    monkeypatch.setattr("vid2ev.cluster.processes.ProcessPoolExecutor", lacking)
    with pytest.raises(DataError, match=f"can begin here .{why.strerror}."), processes(3):
        pass
    monkeypatch.setattr("distributed.LocalCluster", failing)
    with pytest.raises(DataError, match=f"no processes .* can begin here .{why.strerror}.; .*--jobs 1"):
        all_of([Task("a", made.gives_its_process)], Workers(2))


def test_what_cannot_be_meant_is_said_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        pytest.raises(UsageError, match="--memory much: expected a size such as 4GiB"),
        Workers(2, memory="much").client(),
    ):
        pass
    with pytest.raises(UsageError, match="--memory 4: expected a size such as 4GiB, at least 128MiB"):
        Workers(2, memory="4")
    with pytest.raises(UsageError, match="--memory 1e400GB: expected a size such as 4GiB"):
        Workers(2, memory="1e400GB")
    with pytest.raises(UsageError, match="expected an address such as"), Workers(scheduler="nowhere").client():
        pass
    monkeypatch.setattr(workers_module, "REACHED_S", 1)
    with pytest.raises(OSError, match="no Dask scheduler answers"), Workers(scheduler="tcp://127.0.0.1:9").client():
        pass
    monkeypatch.setattr(workers_module, "has_dask", lambda: False)
    with pytest.raises(UsageError, match=r"pip install 'vid2ev\[cluster\]'"), Workers(2).client():
        pass


def test_two_programs_share_work_out_at_once() -> None:
    # (each says in an error if it finds a port taken; what Dask says of that is an error in tests)
    with Workers(jobs=1).client() as one, Workers(jobs=1).client() as other:
        assert [one.submit(int, "1").result(), other.submit(int, "2").result()] == [1, 2]


def test_how_much_of_nothing_is_done_is_not_said() -> None:
    assert share_of(0, 0) == share_of(3, None) == {}
    assert share_of(1, 4) == {"share": 0.25} and share_of(5, 4) == {"share": 1.0}
