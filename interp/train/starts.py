"""What a network begins to learn from, where it is not fresh weights: weights of a network that was trained before, and
weights for parts of it.

    rrin_events_guided-tiny   the network, and which it is: training goes on with new data, or with another recipe
    flow=RUN                  a part, such as the flow of RRINSloMoEvents, trained for itself; `pretrained` parts are
                              frozen, others go on learning
    features=FILE             VGG16, by whose features a loss that looks at features does so (`losses/perceptual.py`)

A run keeps copies of the files, so that it can be carried anywhere, and their digests are part of its job.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from interp import pretrained, weights
from interp.blocks.frozen import Frozen
from interp.losses.perceptual import Perceptual
from interp.networks import make, spec_of
from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from interp.train.learner import Learner

WHOLE = ""  # the part that is the network
FEATURES = "features"  # and that of the loss


def parsed(texts: Iterable[str]) -> dict[str, Path]:
    """Files by the part that they are for, of `WEIGHTS` and `PART=WEIGHTS`.

    Raises UsageError for files that are not there, and parts that are named twice.
    """
    found: dict[str, Path] = {}
    for text in texts:
        named = re.fullmatch(r"([a-z]\w*)=(.+)", text)
        part, path = (named[1], named[2]) if named else (WHOLE, text)
        if part in found:
            raise UsageError(f"start {text}: {f'part {part}' if part else 'the network'} has weights already; give one")
        found[part] = pretrained.path_of(path)
    return found


def network_of(path: Path) -> tuple[str, str, dict[str, Any]]:
    """Which network weights are of: its name, its size, and those options that are not its defaults."""
    name, spec = weights.about(path)
    size = str(spec.pop("size", "tiny"))
    usual = spec_of(name, size).model_dump(mode="json")
    return name, size, {key: value for key, value in spec.items() if key not in usual or value != usual[key]}


def digests(starts: Mapping[str, Path]) -> dict[str, str]:
    """What stands for the files in a job."""
    return {part: hashlib.sha256(path.read_bytes()).hexdigest() for part, path in starts.items()}


def check_frozen(name: str, size: str, options: Mapping[str, Any], parts: Iterable[str]) -> None:
    """Raise UsageError for a network with parts that are not to learn, and have no weights."""
    if WHOLE in (given := {*parts}):
        return
    with torch.device("meta"):
        network = make(name, size, **options)
    for part, module in network.named_children():
        if isinstance(module, Frozen) and part not in given:
            raise UsageError(
                f"network {name}: its {part} is to be pretrained; give the weights of a"
                f" {type(module.module).__name__}, such as --start {part}=RUN"
            )


def begin(learner: Learner, starts: Mapping[str, Path]) -> None:
    """Give what learns the weights, parts last.

    Raises UsageError for a part that it does not have and for weights of another network, DataError for damaged files.
    """
    for part, path in sorted(starts.items()):
        if part == FEATURES:
            learner.features = _seen_by(learner.features, path)
        elif part:
            weights.load_part(learner.network, part, path)
        else:
            weights.fill(learner.network, path)


def _seen_by(features: Perceptual | None, path: Path) -> Perceptual:
    """VGG16 in place of the stand-in."""
    if features is None:
        raise UsageError(f"start {FEATURES}={path}: the loss of this network looks at no features; leave it out")
    return Perceptual(path, features.squared)
