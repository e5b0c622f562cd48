"""A job's parts: the learner, and what feeds it."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import torch
from torch.utils.data import Dataset, default_collate

from interp.data import alter
from interp.data.ahead import Ahead
from interp.data.chance import chance
from interp.data.clip import Clip, remove_half_written, sound_clip, write_clip
from interp.data.inputs import digests_of, known_by
from interp.data.pool import VERSION, Pool, Report
from interp.data.samples import Samples, check_fits, check_targets
from interp.data.sensor_ranges import SENSORS
from interp.data.sequences import Sequences, check_lengths, clipped
from interp.data.settings import ClipSettings
from interp.data.tensors import as_tensor, tensors
from interp.data.validation import EACH, validation_clips
from interp.networks import make
from interp.train.batches import Batch, Feed
from interp.train.event_fed import EventFedLearner
from interp.train.flow import FlowLearner
from interp.train.frame_fed import FrameFedLearner
from interp.train.hdr import HdrLearner
from interp.train.job import EVENT_FED, Job
from interp.train.learner import Learner
from interp.train.schedule import Schedule
from interp.train.true_flows import WithFlowBetween, WithFlows, with_flows
from vid2ev.recording.disk import THEN_RESUME, sync, writing
from vid2ev.sensors.devices import CPU, Device

WITHOUT_END = 1 << 40  # samples
MEASURED_WITH = ("clean", "noisy")  # event sensors


def learner_of(job: Job) -> Learner:
    """The learner, with first weights that are a function of the seed."""
    torch.manual_seed(job.recipe.seed)
    network: Any = make(job.network, job.size, **job.options)
    schedule = Schedule(job.recipe.warm_up, job.recipe.rate_end)  # (how many steps, and so the way down: `Fit`)
    kinds: dict[str, Any] = dict.fromkeys(EVENT_FED, EventFedLearner) | {"hdr": HdrLearner, "flow": FlowLearner}
    return kinds.get(job.network, FrameFedLearner)(job.network, network, job.recipe, schedule)


def check_samples(job: Job) -> None:
    """Raise UsageError unless the samples of a job can be drawn from its clips."""
    check_fits(job.clips, job.samples.size)
    if job.sequences:
        check_lengths(job.clips)
    else:
        check_targets(job.clips, job.samples.targets)


def feed_of(
    job: Job,
    cache: Path,
    step: int,
    workers: int,
    jobs: int,
    report: Report | None = None,
    device: Device = CPU,
    leads: bool = True,
    besides: Collection[Path] = (),
) -> Feed:
    """Samples from a step on, and clips to validate with; `close` of what is returned ends who makes clips.

    cache   a folder for clips; what is missing there is made again
    jobs    processes that make the first clips
    device  what clips to train with are made on: a GPU, by another process, beside the processes that train, for the
            one of them that leads
    besides  folders that are no part of what clips are made of, wherever they are
    """
    pool = Pool(cache, job.clips, job.recipe.seed, device=device, besides=besides, **job.window.model_dump())
    sample = step * job.recipe.batch
    with ExitStack() as undoing:  # (what fails here leaves no process that makes clips for nobody)
        ahead = Ahead(pool, sample) if device.name != "cpu" and leads else None
        if ahead:
            undoing.callback(ahead.close)
            ahead.fill(sample, report)
        else:
            pool.fill(sample, jobs, report)
        validation = validation_of(job, cache / "validation", besides)
        feed = Feed(_samples(job, pool), validation, job.recipe.batch, workers, ahead)
        undoing.pop_all()
    return feed


def _samples(job: Job, pool: Pool) -> Dataset[Batch]:
    if not job.sequences:
        samples = Samples(pool, job.samples, WITHOUT_END, job.colours)
        return WithFlowBetween(samples) if job.network == "flow" else samples
    return WithFlows(Sequences(pool, job.samples, WITHOUT_END, job.colours))


def validation_of(job: Job, cache: Path, besides: Collection[Path] = ()) -> list[tuple[str, Batch]]:
    """Clips of two event sensors, each as a batch of its own, with every instant a target; and what they count for."""
    batches = []
    for sensor in MEASURED_WITH:
        clips = job.clips.model_copy(update={"sensors": SENSORS[sensor]})
        kept = cache / f"{sensor}-{_known_by(job, clips, besides)}"
        for number, clip in enumerate(_kept_clips(job, clips, kept)):
            group = f"{'scenes' if number < job.validation.clips else 'real'}-{sensor}"
            batches.append((group, default_collate([_whole(job, clip, number)])))
    return batches


def _whole(job: Job, clip: Clip, number: int) -> Batch:
    """A clip, as a sample of all its instants."""
    clip = clip if job.colours == 3 else alter.grey(clip)
    sample = tensors(clip, job.clips)
    if job.sequences:
        light = clipped(clip.truth, chance(0, "validation", number)) if job.clips.light == "linear" else {}
        return with_flows(sample | {"truth": as_tensor(clip.truth)} | light)
    inner = torch.arange(1, clip.multiple)
    return sample | {"times": inner.float() / clip.multiple, "truth": as_tensor(clip.truth[1:-1])}


def _known_by(job: Job, settings: ClipSettings, besides: Collection[Path]) -> str:
    """A short name of clips to validate with; others have another."""
    videos = digests_of(job.validation.videos, besides)
    return known_by(settings, job.validation.model_dump_json(), videos, VERSION, besides=besides)


def _kept_clips(job: Job, settings: ClipSettings, cache: Path) -> list[Clip]:
    """The clips to validate with, from their folder if they are all there.  Raises DataError where it cannot be
    written.

    Its file `whole` says how many there are, once all are on the disk.
    """
    whole, count = cache / "whole", job.validation.clips + EACH * len(job.validation.videos)
    said, paths = f"{count}\n".encode(), [cache / f"{number:04d}.npy" for number in range(count)]
    if whole.is_file() and whole.read_bytes() == said:
        clips = [clip for clip in map(sound_clip, paths) if clip]
        if len(clips) == count:
            return clips
    clips = validation_clips(settings, job.validation.clips, job.validation.videos)
    with writing(cache, THEN_RESUME):
        cache.mkdir(parents=True, exist_ok=True)
        whole.unlink(missing_ok=True)
        remove_half_written(cache)
        for path, clip in zip(paths, clips, strict=True):
            write_clip(path, clip)
            sync(path)
        sync(cache)  # (before anything says that they are there)
        whole.write_bytes(said)
        sync(whole)
    return clips
