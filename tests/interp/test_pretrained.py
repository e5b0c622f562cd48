"""Weights that come with the package: each is what its name says, has its card, and is found by its name."""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from interp import pretrained
from interp.light import luminance, to_light
from interp.networks.event_fed import EventFed
from interp.networks.frame_fed import FrameFed
from interp.representation.event_counts import EventCounts
from interp.weights import load
from vid2ev.errors import DataError, UsageError

COME = sorted(pretrained.HERE.glob("*.safetensors"))


@pytest.mark.parametrize("path", COME, ids=lambda path: path.stem)
def test_weights_are_what_their_name_says(path: Path) -> None:
    name, _, size = path.stem.rpartition("-")
    network = load(path)
    assert network.spec.size == size  # type: ignore[union-attr]
    assert path.with_suffix(".md").read_text().startswith(f"# {name}, {size}\n")


def shown(shift_px: float, lit: float = 0.0) -> torch.Tensor:
    """Waves of three colours that move, [1, 3, 48, 64]; a corner of them is lit."""
    y, x = torch.meshgrid(torch.arange(48.0), torch.arange(64.0), indexing="ij")
    x = x + shift_px
    waves = [0.5 + 0.2 * torch.sin(0.35 * x + k) + 0.15 * torch.cos(0.21 * y + 0.13 * x + 2 * k) for k in range(3)]
    return torch.stack(waves)[None] * (1 + lit * (x - shift_px > 30) * (y < 30))


def events(steps: int = 32, nats: float = 0.2) -> EventCounts:
    """Those of an ideal sensor while the waves move by 4 px and the corner lights up and fades."""
    level, off_on = torch.zeros(0), list[torch.Tensor]()
    for k in range(steps + 1):
        light = to_light(shown(4 * k / steps, 0.25 * math.sin(math.pi * k / steps)), "srgb")
        logs = torch.log(luminance(light) + 1e-3)[0, 0]
        if k:
            net = ((logs - level) / nats).round()
            level = level + nats * net
            off_on.append(torch.stack([(-net).clamp(min=0), net.clamp(min=0)]))
        else:
            level = logs
    return EventCounts(torch.stack(off_on, 1)[None], torch.full((1, 2), nats))


def made_of_waves(network: Any) -> torch.Tensor:
    """What a network makes of these, [C, 48, 64]: the image at 0.4 of the time, or the last of some in a row."""
    some, state = events(), None
    if isinstance(network, FrameFed):
        return network(shown(0), shown(4), [0.4], some).images[0, 0]
    for k in range(4):
        voxels = some.voxels(torch.tensor([[k / 4]]), torch.tensor([[(k + 1) / 4]]), network.spec.bins)[:, 0]
        if isinstance(network, EventFed):
            image, state = network(voxels, state or ())
        else:  # (light of which much is beyond the range)
            image, state = network((1.6 * shown(k)).clamp(0.3, 1), voxels, state, torch.tensor([[0.3, 1.0]]))
    return image[0]


# Of eight pixels, as when the weights were scored: of channel k, row 5 + 9 (k mod 5), column 9 (k mod 7).
AS_SCORED = {
    "firenet-paper": [0.5432, 0.5177, 0.5139, 0.5163, 0.5352, 0.4975, 0.5242, 0.5521],
    "hdr-tiny": [1.0353, 0.7444, 0.9505, 0.4323, 0.8428, 0.8458, 0.9482, 1.3021],
    "rrin_events_guided-tiny": [0.6901, 0.4441, 0.6662, 0.3079, 0.553, 0.4458, 0.6652, 0.7745],
    "rrin_light-tiny": [0.6665, 0.4526, 0.6614, 0.312, 0.5509, 0.4156, 0.503, 0.7689],
    "rrin_slomo_events-tiny": [0.685, 0.4411, 0.6662, 0.3051, 0.5529, 0.4478, 0.683, 0.7744],
}


@pytest.mark.parametrize("path", COME, ids=lambda path: path.stem)
def test_weights_are_given_what_they_have_learnt_from(path: Path) -> None:
    """In other units or another order they would make something else of it, which no training undoes."""
    with torch.no_grad():
        image = made_of_waves(load(path).eval())
    found = [float(image[k % len(image), 5 + 9 * (k % 5), 9 * (k % 7)]) for k in range(8)]
    assert found == pytest.approx(AS_SCORED[path.stem], abs=1e-3)


def test_all_together_are_within_forty_megabytes() -> None:
    assert COME and sum(path.stat().st_size for path in COME) <= 40_000_000


def test_weights_are_a_file_or_a_run_or_come_by_their_name(tmp_path: Path) -> None:
    file = tmp_path / pretrained.OF_RUN
    file.touch()
    assert pretrained.path_of(file) == pretrained.path_of(str(file)) == pretrained.path_of(tmp_path) == file
    assert [pretrained.path_of(path.stem) for path in COME] == COME
    assert [pretrained.path_of(path.stem.replace("_", "-")) for path in COME] == COME
    with pytest.raises(UsageError, match=f"no such file.*did you mean {COME[0].stem}.*{COME[-1].stem}"):
        pretrained.path_of(COME[0].stem[:-1])
    with pytest.raises(UsageError, match="no such file"):
        pretrained.path_of(tmp_path / "other" / pretrained.OF_RUN)
    with pytest.raises(UsageError, match="no such file"):
        pretrained.path_of("longer than files can be called " * 999)


@pytest.mark.parametrize("name", [COME[0].stem, COME[0].stem.replace("-", "_"), "run"])
def test_a_run_without_weights_is_not_taken_for_those_that_come_with_vid2ev(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run is called NETWORK_SIZE unless it is said otherwise, as those are."""
    monkeypatch.chdir(tmp_path)
    Path(name).mkdir()
    if name == "run":
        with pytest.raises(UsageError, match=r"run: a folder without weights\.safetensors, and none of"):
            pretrained.path_of(name)
    else:  # (of nobody's training)
        assert pretrained.path_of(name) == COME[0]
    Path(name, "run.json").touch()
    with pytest.raises(UsageError, match=rf"{name}: a run without weights\.safetensors.*--resume"):
        pretrained.path_of(name)
    Path(name, pretrained.OF_RUN).touch()
    assert pretrained.path_of(name) == Path(name, pretrained.OF_RUN)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are no pipes that have names")
def test_weights_from_a_pipe_are_not_waited_for(tmp_path: Path) -> None:
    """As in `--network <(curl ...)`: they are read more than once, and not from front to back."""
    os.mkfifo(tmp_path / "pipe.safetensors")
    with pytest.raises(DataError, match=r"pipe\.safetensors: a pipe, expected a file"):
        pretrained.path_of(tmp_path / "pipe.safetensors")
