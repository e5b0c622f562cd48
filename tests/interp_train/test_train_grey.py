"""Networks of one colour learn from frames as a grey camera takes them, of the clips that others learn from."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from interp import pretrained, weights
from interp.data import alter
from interp.data.clip import Clip
from interp.data.pool import Pool
from interp.data.samples import Samples
from interp.data.sensor_ranges import WHITE
from interp.data.sequences import DARKEST, Sequences, clipped
from interp.methods import METHODS
from interp.networks import make
from interp.train import runs
from interp.train.job import Job
from interp.train.machines import Machines
from interp.train.made_of import learner_of, validation_of
from interp.train.runs import run
from interp.train.starts import WHOLE, begin
from vid2ev.errors import UsageError

ALONE = Machines.of("auto", 1, True, 1)
SMALL = [
    "clips.scenes=0.0", "clips.multiples=[4]", "clips.size=[32, 32]", "samples.size=32", "window.begin=2",
    "window.fresh=0.0", "validation.clips=1", "validations=1", "batch=2", "processes=1", "warm_up=0",
]  # fmt: skip


@pytest.fixture(autouse=True)
def _by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "usable_cores", lambda: 1)  # (processes that make clips take longer to begin than these)


def job(network: str, colours: int = 1, *settings: str, **rest: Any) -> Job:
    return Job.of(network, settings=[*SMALL, f"network.colours={colours}", *settings], **rest)


def test_a_run_is_validated_beside_all_closed_forms_and_goes_on_to_the_same_weights(tmp_path: Path) -> None:
    asked = job("rrin-events-guided", 1, "steps=3")
    done = run(asked, tmp_path / "once", machines=ALONE, quiet=True, workers=0)
    assert done.finished and set(done.scores) == {"scenes-clean", "scenes-noisy"}
    for methods in done.scores.values():
        assert set(methods) == {*METHODS, "network"} and all(math.isfinite(each.psnr) for each in methods.values())
    assert len([*(tmp_path / "once" / "pictures").glob("*.png")]) >= 2
    after_one = iter([True])
    begun = run(asked, tmp_path / "twice", machines=ALONE, quiet=True, workers=0, stop=lambda: next(after_one))
    assert begun.step == 1
    assert run(asked, tmp_path / "twice", resume=True, machines=ALONE, quiet=True, workers=0).finished
    once, twice = (torch.load(tmp_path / name / "checkpoint.ckpt")["state_dict"] for name in ("once", "twice"))
    assert all(torch.equal(once[name], twice[name]) for name in once)
    kept = weights.load(tmp_path / "once" / "weights.safetensors")
    assert kept.spec.colours == 1  # type: ignore[union-attr]
    assert all(part.isfinite().all() for part in load_file(tmp_path / "once" / "weights.safetensors").values())


def test_samples_are_those_of_three_colours_in_grey(tmp_path: Path) -> None:
    asked = job("rrin")
    pool = Pool(tmp_path, asked.clips, 0, **asked.window.model_dump())
    three, one = (Samples(pool, asked.samples, 9, colours) for colours in (3, 1))
    for number in range(9):
        colours, grey = three[number], one[number]
        assert {name: part.shape for name, part in grey.items() if name not in ("frames", "truth")} == {
            name: part.shape for name, part in colours.items() if name not in ("frames", "truth")
        }
        assert all(torch.equal(grey[name], colours[name]) for name in ("off_on", "footprint", "contrast", "times"))
        for name in ("frames", "truth"):
            codes = (255 * colours[name]).round().byte().movedim(1, -1).numpy()
            clip = Clip(codes, codes, np.zeros((2, 1, 32, 32)), (0.2, 0.2), 1, {})
            np.testing.assert_array_equal((255 * grey[name]).round().byte()[:, 0], alter.grey(clip).truth[..., 0])


def test_light_of_one_colour_is_clipped_as_luminance(tmp_path: Path) -> None:
    light = np.full((3, 8, 8, 1), 0.5, np.float16)
    light[:, :4] = 40.0
    sample = clipped(light, np.random.default_rng(0))
    low, high = sample["range"]
    assert DARKEST[0] <= low * WHITE <= DARKEST[1] and high - low > 0
    assert sample["clipped"].shape == (3, 1, 8, 8) and bool((sample["clipped"][:, :, :4] > 0.99).all())
    wanted = ((0.5 - low) / (high - low)).clamp(0, 1)
    assert abs(float(sample["clipped"][:, :, 4:].mean() - wanted)) < 0.01
    asked = job("hdr")
    pool = Pool(tmp_path, asked.clips, 0, **asked.window.model_dump())
    sequence = Sequences(pool, asked.samples, 3, 1)[0]
    assert sequence["clipped"].shape == sequence["truth"].shape == (5, 1, 32, 32)


@pytest.mark.parametrize("network", ["rrin", "hdr"])
def test_clips_to_validate_with_are_those_of_other_networks_in_grey(tmp_path: Path, network: str) -> None:
    colours = validation_of(job(network, 3), tmp_path)
    clips = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    grey = validation_of(job(network, 1), tmp_path)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == clips
    for (group, three), (same, one) in zip(colours, grey, strict=True):
        assert group == same and torch.equal(one["off_on"], three["off_on"])
        assert one["truth"].shape == (*three["truth"].shape[:2], 1, 32, 32) and one["frames"].shape[2] == 1
        least, most = three["truth"].amin(2, keepdim=True), three["truth"].amax(2, keepdim=True)
        assert bool(((one["truth"] >= least - 0.01) & (one["truth"] <= most + 0.01)).all())


def test_networks_that_take_no_frames_have_no_colours() -> None:
    with pytest.raises(UsageError, match="firenet has no option 'colours'"):
        job("firenet")
    assert Job.of("firenet").colours == 3


@pytest.mark.parametrize(
    ("network", "settings", "part", "of"),
    [
        ("rrin_events_guided", ["network.colours=1"], WHOLE, 3),
        ("rrin_slomo_events", ["network.colours=1", "network.flow=pretrained"], "flow", 3),
        ("rrin_slomo_events", ["network.flow=pretrained"], "flow", 1),
    ],
)
def test_weights_of_other_colours_are_refused_in_a_sentence(
    tmp_path: Path, network: str, settings: list[str], part: str, of: int
) -> None:
    path = pretrained.path_of("rrin_events_guided-tiny")
    if part:
        weights.save(path := tmp_path / "flow.safetensors", "flow", make("flow", colours=of))
    starts = {part: path}
    asked = Job.of(None if part == WHOLE else network, settings=settings, starts=starts)
    with pytest.raises(
        UsageError, match=rf"colours = {of}, and this one has {4 - of}; choose network\.colours = {of}"
    ) as refused:
        begin(learner_of(asked), starts)
    assert "\n" not in str(refused.value)


def test_weights_of_one_colour_begin_a_network_of_one(tmp_path: Path) -> None:
    weights.save(tmp_path / "one.safetensors", "rrin", make("rrin", colours=1))
    assert Job.of(starts={WHOLE: tmp_path / "one.safetensors"}).colours == 1
