"""Networks that take two frames learn to rebuild what is between them.

A batch has, as of `interp.data.samples`, frames [B, 2, C, H, W] codes 0 ... 1, off_on [B, 2, S, H, W], contrast [B, 2]
and footprint [B] of the events between them, times [B, N], and truth [B, N, C, H, W] codes at these.
"""

from __future__ import annotations

import numpy as np
import torch

from interp.losses import objectives
from interp.losses.perceptual import Perceptual
from interp.methods import METHODS, Gap, open_method
from interp.networks.frame_fed import FrameFed, Interpolated, joined
from interp.representation.event_counts import EventCounts
from interp.train.batches import Batch
from interp.train.learner import Learner
from interp.train.pictures import of_error, of_events, rows, shown
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.scores import Scores, scores

OF_FEATURES = ("superslomo", "slomo_events", "timelens")  # whose loss looks at them, too


class FrameFedLearner(Learner):
    """A network that takes two frames, with the loss that its name stands for, or what guides it."""

    network: FrameFed

    def __init__(self, name: str, network: FrameFed, recipe: Recipe, schedule: Schedule):
        features = Perceptual(squared=name != "timelens") if name in OF_FEATURES else None
        super().__init__(network, recipe, schedule, features)
        self.of = name
        self.nearly_right = name == "rrin_light" or network.spec.guided  # before it learns

    def made(self, batch: Batch) -> Interpolated:
        """What the network makes of a batch: where it matters, of events that are as coarse as each other at a time."""
        if not self.network.spec.guided:
            return self._made(batch)
        footprints, counts = batch["footprint"].unique(return_counts=True)
        if len(footprints) == 1:
            return self._made(batch, int(footprints))
        order = batch["footprint"].argsort(stable=True)
        groups = zip(footprints.tolist(), order.split(counts.tolist()), strict=True)
        made = [self._made({name: each[some] for name, each in batch.items()}, wide) for wide, some in groups]
        return joined(made, order.argsort())

    def _made(self, batch: Batch, footprint: int = 1) -> Interpolated:
        first, last = batch["frames"].unbind(1)
        return self.network(first, last, batch["times"], events_of(batch, footprint))

    def parts(self, batch: Batch) -> objectives.Terms:
        """Terms of the loss."""
        made, truth = self.made(batch), batch["truth"]
        if self.of == "timelens":
            return objectives.time_lens(made, truth, self.features)  # type: ignore[arg-type]
        if self.features is not None:
            first, last = batch["frames"].unbind(1)
            return objectives.super_slomo(made, first, last, truth, self.features)
        if self.nearly_right:
            return objectives.by_ratio(made, truth)
        if self.of == "rrin_events_light":
            return objectives.supervised_residue(made, truth, self.schedule.progress(self.trainer.global_step))
        return objectives.residue(made, truth)

    def predicted(self, clip: Batch) -> torch.Tensor:
        """Images [N, C, H, W] codes of one pair."""
        return self.made(clip).images[0]

    def scored(self, clip: Batch, images: torch.Tensor) -> list[Scores]:
        """One for each of the images."""
        return scores(images, clip["truth"][0], *clip["frames"][0])

    def baselines(self, clip: Batch) -> dict[str, torch.Tensor]:
        """Images of the methods without training."""
        return {name: open_method(name).between(gap_of(clip), clip["times"][0]) for name in METHODS}

    def picture(self, clip: Batch, images: torch.Tensor) -> np.ndarray:
        """First frame, events up to the target, bridge, prediction, truth, error, last frame; a row per target."""
        events, times, truth = events_of(clip), clip["times"][0], clip["truth"][0]
        first, last = clip["frames"][0]
        bridge = open_method("bridge").between(gap_of(clip), times)
        return rows(
            [
                first,
                of_events(events, float(times[n]), first),
                bridge[n],
                images[n],
                truth[n],
                of_error(images[n], truth[n]),
                last,
            ]
            for n in shown(len(times))
        )


def events_of(batch: Batch, footprint: int = 1) -> EventCounts:
    """The events of a batch; `footprint` is that of all of them, where it matters."""
    return EventCounts(batch["off_on"], batch["contrast"], footprint)


def gap_of(clip: Batch) -> Gap:
    """The only pair of frames of a batch."""
    first, last = clip["frames"][0]
    return Gap(first, last, events_of(clip, int(clip["footprint"])))
