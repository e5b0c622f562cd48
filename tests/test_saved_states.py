"""What is kept to go on from is believed only where it can be true; what a kill leaves is in nobody's way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from interp.evaluate import kept as kept_module
from interp.evaluate.kept import Kept
from interp.train.run_folder import RunFolder
from vid2ev import Cis, Dvs, convert, load_cis, load_sensor
from vid2ev.commands import main
from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import Recording
from vid2ev.recording.destination import partial_of
from vid2ev.recording.disk import put_in_place
from vid2ev.recording.held import Held
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.tracks.outputs import Outputs

CLIP = "synthetic:moving-edge,size=16x12,fps=100,duration_s=0.08"
OPTIONS = {"overrides": ["frame_rate_hz=900", "delay_us=3000"], "threads": 1, "piece": 3 << 18}


class Stopped(Exception):
    pass


def begun(out: Path) -> Path:
    """The checkpoint of a recording that was stopped on the way."""
    count = iter(range(100))

    def report(*_: object) -> None:
        if next(count) == 6:
            raise Stopped

    with pytest.raises(Stopped):
        convert(CLIP, out, report=report, **OPTIONS)
    return partial_of(out) / "checkpoint.npz"


def state_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as arrays:
        return dict(arrays)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("track0.dvs.delayed_x", lambda x: np.append(x, 99)),
        ("track0.dvs.held_t", lambda t: np.append(t, 1)),
        ("track0.dvs.clock", lambda clock: clock.astype(np.float64)),
        ("track0.film.starts", lambda starts: starts + (1 << 40)),
        ("track0.film.counts", lambda counts: counts[:, :-1]),
        ("track0.dvs.tallies", lambda tallies: tallies[None]),
        ("progress", lambda progress: np.array(str(progress).replace('"frames"', '"framed"'))),
        ("progress", lambda _: np.array("[" * 5000)),
        ("progress", lambda progress: np.array(str(progress).replace('"start_ns": 0', '"start_ns": -1'))),
        ("track0.last_us", lambda _: np.array(1 << 50)),  # (9 GB of EVT3 that says that nothing happens)
        ("size.t", lambda size: size + (1 << 40)),
        ("size.t", None),
    ],
)
def test_checkpoints_that_cannot_be_are_one_sentence(name: str, change: object, tmp_path: Path) -> None:
    path = begun(tmp_path / "out")
    state = state_of(path)
    wanted = state.pop(name)
    if change is not None:
        np.savez(path, **state, **{name: change(wanted)})  # type: ignore[operator]
    else:
        np.savez(path, **state)
    with pytest.raises(DataError, match="--overwrite starts again") as raised:
        convert(CLIP, tmp_path / "out", resume=True, **OPTIONS)
    assert "\n" not in str(raised.value)
    convert(CLIP, tmp_path / "out", overwrite=True, **OPTIONS)


def test_a_checkpoint_that_is_cut_short_is_one_sentence(tmp_path: Path) -> None:
    path = begun(tmp_path / "out")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(DataError, match=r"checkpoint.npz is damaged, or not of this recording \(BadZipFile\)"):
        convert(CLIP, tmp_path / "out", resume=True, **OPTIONS)


def test_of_a_damaged_checkpoint_nobody_is_told_that_it_can_be_gone_on_with(tmp_path: Path) -> None:
    path = begun(tmp_path / "out")
    options = [f"--{key}={value}" for key, value in (("threads", 1), ("output", tmp_path / "out"))]
    options += [f"--set={change}" for change in OPTIONS["overrides"]]  # type: ignore[attr-defined]
    path.write_bytes(path.read_bytes()[:-100])
    said = CliRunner().invoke(main, ["convert", CLIP, *options, "--resume"])
    assert said.exit_code == 1 and said.output.endswith("--overwrite starts again\n")


@pytest.mark.parametrize("kind", ["hdf5", "evt3", "csv"])
def test_events_that_cannot_be_are_not_written(kind: str, tmp_path: Path) -> None:
    """As a checkpoint with another time in it leaves them."""
    one = np.ones(2, np.uint8)
    held = Events(np.array([9, 3]), one.astype(np.uint16), one.astype(np.uint16), one)
    with pytest.raises(DataError, match="--overwrite starts again"):
        Outputs(formats=(kind,)).write(tmp_path, Recording((16, 12), 0, 10, 2, lambda: iter([held])))


def test_a_sensor_takes_no_state_of_another_kind() -> None:
    dvs = Dvs(load_sensor("ideal"), (16, 12))
    dvs.step(np.full((12, 16), 0.5, np.float32), 0)
    state = dvs.state()
    for name in state:
        with pytest.raises(UsageError, match=f"in '{name}', expected"):
            dvs.restore(state | {name: state[name].astype(np.complex64)})
    dvs.restore(state)


SENT = ("t", "x", "y", "p", "label")
OF_DVS = (
    "fast", "rest", "memory", "drawn", "t_last", "count", "t_reset", "tallies", "clock", "polarities", "frame_origin",
    "frame_last", *(f"held_{name}" for name in SENT), *(f"delayed_{name}" for name in SENT), "of",
)  # fmt: skip
OF_CIS = ("light", "open", "totals", "pending", "counts", "clock", "of")


@pytest.mark.parametrize(("kind", "name"), [*(("dvs", name) for name in OF_DVS), *(("cis", name) for name in OF_CIS)])
def test_a_refused_state_changes_nothing(kind: str, name: str) -> None:
    """Whichever entry is wrong: what comes next is that of a sensor that was never asked."""
    light = np.random.default_rng(2).uniform(0, 1, (12, 20, 40, 3)).astype(np.float32)
    light[1:, 10:] = light[0, 10:]  # (half of it still, where strips sleep)
    frames = [Frame(each if kind == "cis" else each[..., 0], k * 4_000_000) for k, each in enumerate(light)]
    untouched, asked = ((_dvs if kind == "dvs" else _cis)() for _ in range(2))
    _sent(untouched, frames[:9])
    _sent(asked, frames[:4])
    early = asked.state()
    _sent(asked, frames[4:9])
    assert early.keys() == set(OF_DVS if kind == "dvs" else OF_CIS)
    with pytest.raises(UsageError, match=f"'{name}'"):
        asked.restore(early | {name: early[name].astype(np.complex64)})
    assert asked.counts == untouched.counts
    ours, theirs = _sent(asked, frames[9:]), _sent(untouched, frames[9:])
    assert ours[0].size and all(np.array_equal(one, other) for one, other in zip(ours, theirs, strict=True))
    one, other = asked.state(), untouched.state()
    assert all(np.array_equal(one[each], other[each]) for each in other)


def _dvs() -> Dvs:
    return Dvs(load_sensor("ideal", ["delay_us=3000", "frame_rate_hz=200"]), (40, 20), 5)


def _cis() -> Cis:
    return Cis(load_cis("ideal", ["frame_rate_hz=120", "exposure_us=8000"]), (40, 20), 5)


def _sent(sensor: Any, frames: list[Frame]) -> list[np.ndarray]:
    """The columns of the events, or the codes of the exposures."""
    if isinstance(sensor, Cis):
        return [exposure.codes for frame in frames for exposure in sensor.see(frame)]
    events = Events.concatenate([sensor.see(frame) for frame in frames])
    return [events.t, events.x, events.y, events.p]


@pytest.mark.parametrize("keys", [[], ["frame_rate_hz=3"], ["delay_us=900"]])
def test_an_empty_state_is_that_of_a_sensor_without_light(keys: list[str]) -> None:
    light = np.random.default_rng(1).uniform(0, 1, (9, 12, 16)).astype(np.float32)
    used, new = (Dvs(load_sensor("paper", keys), (16, 12), 5) for _ in range(2))
    used.steps(light, [k * 10**7 for k in range(9)])
    used.restore(new.state())
    assert used.counts == new.counts and not used.state()
    for sensor in (used, new):
        sensor.steps(light, [10**9 + k * 10**7 for k in range(9)])
    one, other = used.state(), new.state()
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], name)


@pytest.mark.parametrize("changed", [{"seed": 6}, {"camera": 1}, {"size": (12, 16)}, {"key": "frame_rate_hz=40"}])
@pytest.mark.parametrize("kind", ["dvs", "cis"])
def test_a_sensor_takes_no_state_of_another_one(kind: str, changed: dict[str, Any]) -> None:
    def sensor(seed: int = 5, camera: int = 0, size: tuple[int, int] = (16, 12), key: str = "") -> Any:
        make, load = (Dvs, load_sensor) if kind == "dvs" else (Cis, load_cis)
        made = make(load("paper", [key] if key else []), size, seed, camera=camera)
        frame = Frame(np.full((*size[::-1], 3)[: 2 + (kind == "cis")], 0.5, np.float32), 0)
        made.see(frame) if kind == "dvs" else list(made.exposures(frame))
        return made

    one = sensor()
    with pytest.raises(
        UsageError, match="another sensor's state, which has other parameters, or another size, seed or camera"
    ):
        one.restore(sensor(**changed).state())
    one.restore(sensor().state())


def test_what_a_kill_leaves_before_anything_has_begun_is_in_nobodys_way(tmp_path: Path) -> None:
    for name in ("lock", "run.json.new", "job.json.new"):
        for folder in ("run", "eval"):
            (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / ("eval" if name == "job.json.new" else "run") / name).write_text("{")
    run = RunFolder(tmp_path / "run", {"a": 1}, resume=False)
    run.close()
    assert {path.name for path in (tmp_path / "run").iterdir()} == {"run.json"}
    with Kept(tmp_path / "eval", {"a": 1}, {"linear": 1}, resume=False):
        pass
    assert {path.name for path in (tmp_path / "eval").iterdir()} == {"job.json"}
    (tmp_path / "eval" / "notes.txt").write_text("mine")
    (tmp_path / "eval" / "job.json").unlink()
    with pytest.raises(UsageError, match="holds something else"):
        Kept(tmp_path / "eval", {"a": 1}, {"linear": 1}, resume=False)


def test_what_cannot_be_begun_lets_others_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for _ in range(2):  # (a lock left behind would be in the way of the second)
        with pytest.raises(DataError, match=r"gone\.safetensors|cannot be written"):
            RunFolder(tmp_path / "run", {"a": 1}, resume=False, starts={"flow": tmp_path / "gone.safetensors"})
    RunFolder(tmp_path / "run", {"a": 1}, resume=False).close()

    def full(*_: object) -> bytes:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(kept_module, "_line", full)
        for _ in range(2):
            with pytest.raises(DataError, match="No space left on device"):
                Kept(tmp_path / "eval", {"a": 1}, {"linear": 1}, resume=False)
    assert not (tmp_path / "eval").exists()


def test_what_another_has_begun_until_the_folder_is_free_is_respected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = {
        tmp_path / "run" / "run.json": {"job": {"a": 2}},
        tmp_path / "eval" / "job.json": {"a": 1, "methods": {"bridge": 2}},
        tmp_path / "more" / "job.json": {"a": 1, "methods": {"bridge": 2}},
    }
    with Kept(tmp_path / "more", {"a": 1}, {"linear": 1}, resume=False):
        pass

    take = Held.take

    def waited_for(held: Held) -> None:
        take(held)
        for path, job in theirs.items():
            if path.parent == held.folder:
                path.write_text(json.dumps(job))

    monkeypatch.setattr(Held, "take", waited_for)
    with pytest.raises(UsageError, match="holds a run; --resume"):
        RunFolder(tmp_path / "run", {"a": 1}, resume=False)
    with pytest.raises(UsageError, match="holds an evaluation; --resume"):
        Kept(tmp_path / "eval", {"a": 1}, {"linear": 1}, resume=False)
    with Kept(tmp_path / "more", {"a": 1}, {"linear": 1}, resume=True):
        pass
    run, evaluated, more = (json.loads(path.read_text()) for path in theirs)
    assert run["job"] == {"a": 2} and evaluated["methods"] == {"bridge": 2}
    assert more["methods"] == {"bridge": 2, "linear": 1}
    assert not list(tmp_path.rglob("lock"))


def test_less_than_nothing_cannot_have_been_evaluated(tmp_path: Path) -> None:
    with Kept(tmp_path / "eval", {"a": 1}, {"linear": 1}, resume=False) as kept:
        unfit: dict[str, dict[str, list[str]]] = {"linear": {}}
        for groups, missing in ((-3, 0), (3, -1)):
            about = {"groups": groups, "missing": {"linear": missing}, "unfit": unfit}
            kept.finish("film", about)
            with pytest.raises(DataError, match="below zero"):
                kept.about("film")
        kept.finish("film", {"groups": 3, "missing": {"linear": 0}, "unfit": unfit})
        assert kept.about("film") == {"groups": 3, "missing": {"linear": 0}, "unfit": unfit}


def test_a_folder_that_is_being_removed_says_to_the_last_whose_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed at any instant of that, what is left can be gone on from or begun anew."""
    begun(tmp_path / "out")
    removed: list[str] = []
    real = Path.unlink

    def noted(self: Path, missing_ok: bool = False) -> None:
        removed.append(self.name)
        real(self, missing_ok)

    monkeypatch.setattr(Path, "unlink", noted)
    with pytest.raises(DataError):
        convert(CLIP, tmp_path / "out", overwrite=True, report=_fails, **OPTIONS)
    assert removed[0] == "checkpoint.npz" and removed.index("job.json") > removed.index("t")
    assert not partial_of(tmp_path / "out").exists()


def _fails(*_: object) -> None:
    raise DataError("at once")


def test_folders_are_exchanged_at_once_where_the_system_can(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from vid2ev.recording import disk

    for swapped in (True, False):
        for name in ("made", "there"):
            (tmp_path / name).mkdir()
            (tmp_path / name / name).touch()
        if not swapped:
            monkeypatch.setattr(disk, "_swapped", lambda *_: False)
        put_in_place(tmp_path / "made", tmp_path / "there", tmp_path / "replaced")
        assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["replaced", "there", "there", "made"]
        assert (tmp_path / "there" / "made").exists() and (tmp_path / "replaced" / "there").exists()
        for name in ("there", "replaced"):
            (tmp_path / name / {"there": "made", "replaced": "there"}[name]).unlink()
            (tmp_path / name).rmdir()
