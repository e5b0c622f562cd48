"""Training that begins with weights: they are what it begins with, frozen parts stay, and a run carries its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import load_file, save_file
from small_run import Made, clips
from vgg16 import write_vgg16

from interp import pretrained, weights
from interp.networks import make
from interp.train import runs
from interp.train.batches import Feed
from interp.train.fit import Fit
from interp.train.job import Job
from interp.train.machines import Machines
from interp.train.run_folder import RunFolder
from interp.train.runs import run
from interp.train.starts import WHOLE, parsed
from vid2ev.errors import DataError, UsageError

SHIPPED = "rrin_events_guided-tiny"
FEW = ["steps=2", "batch=2", "processes=1", "validations=1", "warm_up=0"]
ALONE = Machines.of("auto", 1, True, 1)
COMBINED = ["network.flow=pretrained", *FEW]


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "feed_of", lambda job, *_: Feed(Made(), clips(1), job.recipe.batch, 0))


@pytest.fixture
def flow(tmp_path: Path) -> Path:
    """Weights of a network for flow."""
    torch.manual_seed(7)
    network = make("flow", "tiny")
    torch.nn.init.normal_(network.unet.head.weight, std=0.01)  # type: ignore[arg-type, union-attr]
    weights.save(tmp_path / "flow.safetensors", "flow", network)
    return tmp_path / "flow.safetensors"


def trained(path: Path, settings: list[str], starts: dict[str, Path], **rest: Any) -> Any:
    return run(Job.of(settings=settings, starts=starts, **rest), path, machines=ALONE, quiet=True, starts=starts)


def learnt(path: Path) -> dict[str, torch.Tensor]:
    """All that was learnt by the last step of a run."""
    return torch.load(path / "checkpoint.ckpt", weights_only=False)["state_dict"]


def test_it_begins_with_the_weights_of_a_file(tmp_path: Path) -> None:
    """The network and its options are those of the file, and the weights that come with vid2ev go by their name; where
    nothing is learnt weights stay."""
    assert Job.of(settings=FEW, starts=parsed([SHIPPED])).network == "rrin_events_guided"
    torch.manual_seed(8)
    weights.save(
        tmp_path / "given.safetensors", "rrin_events_guided", make("rrin_events_guided", "tiny", flow_scale=3.0)
    )
    starts = parsed([str(tmp_path / "given.safetensors")])
    job = Job.of(settings=FEW, starts=starts)
    assert (job.network, job.size, job.options) == ("rrin_events_guided", "tiny", {"flow_scale": 3.0})
    done = run(job, tmp_path / "run", machines=ALONE, quiet=True, starts=starts)
    assert done.finished
    trained(tmp_path / "still", [*FEW, "rate=1e-30", "weight_decay=0"], starts)
    kept, given = (load_file(path) for path in (tmp_path / "still" / "weights.safetensors", starts[WHOLE]))
    assert all(torch.equal(kept[name], given[name].float()) for name in given)


def test_a_pretrained_part_stays_and_what_is_around_it_learns(tmp_path: Path, flow: Path) -> None:
    starts = {"flow": flow}
    assert trained(tmp_path / "run", [*COMBINED, "rate=0.1"], starts, network="rrin-slomo-events").finished
    given, kept = load_file(flow), load_file(tmp_path / "run" / "weights.safetensors")
    assert all(torch.equal(kept[f"flow.module.{name}"], given[name]) for name in given)
    network = weights.load(tmp_path / "run" / "weights.safetensors")
    torch.testing.assert_close(network.flow.module.state_dict(), given, rtol=0, atol=0)  # type: ignore[union-attr]
    own = ["network.flow=own", *FEW, "rate=0.01"]
    trained(tmp_path / "own", own, starts, network="rrin-slomo-events")
    state = learnt(tmp_path / "own")
    assert any(not torch.equal(state[f"network.flow.{name}"], given[name]) for name in given)


def test_a_run_carries_what_it_began_with(tmp_path: Path, flow: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped before its first checkpoint and carried to where the file is not, it goes on to the same weights."""
    starts = {"flow": flow}
    trained(tmp_path / "whole", COMBINED, starts, network="rrin-slomo-events")

    def stopped(_: Fit) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Fit, "run", stopped)
        trained(tmp_path / "stopped", COMBINED, starts, network="rrin-slomo-events")
    (tmp_path / "stopped").rename(tmp_path / "carried")
    flow.unlink()
    job = Job(**json.loads((tmp_path / "carried" / "run.json").read_text())["job"])
    assert run(job, tmp_path / "carried", resume=True, machines=ALONE, quiet=True).finished
    ends = [load_file(tmp_path / name / "weights.safetensors") for name in ("whole", "carried")]
    assert ends[0].keys() == ends[1].keys() and all(torch.equal(ends[0][name], ends[1][name]) for name in ends[0])


def test_a_loss_looks_by_vgg16_if_it_is_given(tmp_path: Path) -> None:
    """And a run that was stopped and carried to where the file is not goes on by it, to the same weights."""
    write_vgg16(tmp_path / "vgg16.safetensors")
    starts = parsed([f"features={tmp_path / 'vgg16.safetensors'}"])
    trained(tmp_path / "whole", FEW, starts, network="superslomo")
    trained(tmp_path / "without", FEW, {}, network="superslomo")
    job = Job.of("superslomo", settings=FEW, starts=starts)
    after_one = iter([True])
    run(job, tmp_path / "carried", machines=ALONE, quiet=True, starts=starts, stop=lambda: next(after_one))
    (tmp_path / "vgg16.safetensors").unlink()
    assert run(job, tmp_path / "carried", resume=True, machines=ALONE, quiet=True).finished
    whole, carried, without = (learnt(tmp_path / name) for name in ("whole", "carried", "without"))
    assert all(torch.equal(whole[name], carried[name]) for name in whole)
    assert any(not torch.equal(whole[name], without[name]) for name in whole)


def test_a_run_goes_on_only_with_the_weights_it_began_with(tmp_path: Path, flow: Path) -> None:
    job = Job.of("rrin-slomo-events", settings=COMBINED, starts={"flow": flow})
    RunFolder(tmp_path / "run", job.kept(), False, starts={"flow": flow}).close()
    weights.save(flow, "flow", make("flow", "tiny"))
    other = Job.of("rrin-slomo-events", settings=COMBINED, starts={"flow": flow})
    with pytest.raises(UsageError, match=r"was begun with starts.flow = "):
        run(other, tmp_path / "run", resume=True, machines=ALONE, quiet=True)


def test_a_job_without_weights_is_kept_as_it_was_before_there_were_any() -> None:
    assert "starts" not in Job.of().kept() and Job(**Job.of().kept()) == Job.of()


@pytest.mark.parametrize(
    ("network", "settings", "starts", "sentence"),
    [
        ("rrin-slomo-events", ["network.flow=pretrained"], [], "its flow is to be pretrained; .* of a FlowNetwork"),
        ("rrin-slomo-events", ["network.reconstruct=firenet", "network.reconstruct_weights=pretrained"], [],
         "its reconstruct is to be pretrained; give the weights of a FireNet"),
        ("rrin", [], [SHIPPED], "holds weights of rrin_events_guided, tiny, not of rrin; leave --network"),
        (None, [], ["rrin_event-tiny"], r"no such file, and none of those that come with vid2ev"),
        (None, [], [SHIPPED, SHIPPED], "the network has weights already; give one"),
        ("rrin", [], [f"flow={SHIPPED}", f"flow={SHIPPED}"], "part flow has weights already"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused(
    network: str | None, settings: list[str], starts: list[str], sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence) as error:
        Job.of(network, settings=settings, starts=parsed(starts))
    assert "\n" not in str(error.value)


def test_a_file_that_says_more_than_it_holds_is_refused(tmp_path: Path, flow: Path) -> None:
    """Before anything of that size is made."""
    save_file(load_file(flow), tmp_path / "lies", {"network": "flow", "spec": '{"size": "paper"}'})
    with pytest.raises(DataError, match="lies holds the weights of another network"):
        Job.of(starts={WHOLE: tmp_path / "lies"})


def test_weights_that_do_not_fit_are_refused_before_anything_is_there(tmp_path: Path, flow: Path) -> None:
    shipped = pretrained.path_of(SHIPPED)
    for part, path, sentence in (
        ("flow", shipped, "holds the weights of another network"),
        ("flows", flow, "has no part 'flows'; it has flow"),
        ("features", flow, "the loss of this network looks at no features"),
    ):
        with pytest.raises(UsageError, match=sentence):
            trained(tmp_path / "run", FEW, {part: path}, network="rrin-slomo-events")
    with pytest.raises(UsageError, match="holds the weights of another network, rrin_events_guided"):
        trained(tmp_path / "run", ["network.bins=3", *FEW], {WHOLE: shipped})
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("asked_at", [1, 2, 3, None])
def test_who_is_asked_to_end_while_the_first_clips_are_made_does_so(
    asked_at: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the next clip, or where processes that make clips ended, as they were asked, too; it goes on there."""
    made, job = 0, Job.of(settings=FEW)

    def broken(job: Job, cache: Path, step: int, workers: int, jobs: int, report: Any, *_: Any) -> Any:
        nonlocal made
        for made in (1, 2):
            report(made, 3)
        made = 3
        raise DataError("a process that did part of the work was ended")

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt if asked_at else DataError):
        patch.setattr(runs, "feed_of", broken)
        run(job, tmp_path, machines=ALONE, quiet=True, interrupted=lambda: made == asked_at)
    assert made == (asked_at or 3)
    assert run(job, tmp_path, resume=True, machines=ALONE, quiet=True).finished
