"""`vid2ev convert`: a video in, the recording of an event camera out."""

from __future__ import annotations

import json
import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import click

from vid2ev.commands.auto import Auto
from vid2ev.commands.options import FiniteRange
from vid2ev.commands.source_options import source_options
from vid2ev.commands.worker_options import worker_options


@click.command(short_help="Turn a video into the recording of an event camera.")
@click.argument("videos", nargs=-1, required=True, metavar="VIDEO...")
@click.option(
    "-o", "--output", metavar="DIR",
    help="Folder to make; of several videos, or with a slash at its end, the folder for their folders."
    "  [default: NAME_events here]",
)  # fmt: skip
@click.option(
    "--sensor", default="paper", show_default=True, metavar="PRESET|FILE", help="`vid2ev sensors` lists them."
)
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of the sensor; may be repeated."
)
@click.option(
    "--rig",
    metavar="FILE",
    type=click.Path(dir_okay=False),
    help="Cameras around the video's; `vid2ev init` writes a file.",
)
@click.option(
    "--depth", metavar="DEPTH",
    help="How far the scene is, for cameras that stand elsewhere: plane:METRES, a map or a folder of maps, model:NAME.",
)  # fmt: skip
@click.option(
    "--frames", "frame_camera", is_flag=True, help="A frame camera, too, in the same place, if the rig has none."
)
@click.option(
    "--cis", metavar="PRESET|FILE", help="Sensor of frame cameras; without a rig, as --frames.  [default: paper]"
)
@click.option(
    "--upsample", default="flow", show_default=True, metavar="none|linear|flow|net",
    help="Light between the frames: a straight line, the same in steps, carried along the estimated motion, or by a"
    " network (net:WEIGHTS).",
)  # fmt: skip
@click.option(
    "--subframes",
    type=Auto("auto", 1, "subframes"),
    default="auto",
    show_default=True,
    help="Parts of an interval; auto: as motion and contrast ask.",
)
@click.option(
    "--max-subframes",
    type=click.IntRange(1),
    default=64,
    show_default=True,
    metavar="N",
    help="The most that auto may take.",
)
@click.option(
    "--cuts", type=click.Choice(["restart", "keep"]), default="restart", show_default=True,
    help="After a cut the sensor starts afresh, or sees a step of light.",
)  # fmt: skip
@source_options
@click.option(
    "--seed",
    type=Auto("random", 0, "seed"),
    default=0,
    show_default=True,
    help="Another seed is another camera of the same kind.",
)
@click.option(
    "--threads",
    type=click.IntRange(1),
    metavar="N",
    help="Changes nothing but the time it takes.  [default: all cores; with --jobs a job's share of them]",
)
@worker_options("Videos")
@click.option(
    "--split", metavar="tiles|cuts|chain|approximate[:N]", help="Split each video among the workers: by parts of its"
    " pixels, at its cuts, or in turn (N minutes each), which change nothing but the time it takes; or in time at"
    " seams, near which events differ.",
)  # fmt: skip
@click.option(
    "--device", type=click.Choice(["cpu", "cuda", "auto"]), default="cpu", show_default=True,
    help="Where light and events are made; auto: on a GPU, if there is one and enough to do.",
)  # fmt: skip
@click.option(
    "--skip/--no-skip", default=True,
    help="Skip pixels in which nothing can happen; changes nothing but the time it takes.  [default: yes]",
)  # fmt: skip
@click.option(
    "--bayer", type=click.Choice(["RGGB", "BGGR", "GRBG", "GBRG"], case_sensitive=False),
    help="Colour filters before the pixels of event cameras.  [default: none, they see luminance]",
)  # fmt: skip
@click.option(
    "--effects", default="all", show_default=True, metavar="all|auto|none|NAME[,NAME...]",
    help="Effects to simulate; auto: those that the clip calls for, found while it is converted (`vid2ev plan`)."
    " That says what matters; it rarely saves time, and may take twice as long.",
)  # fmt: skip
@click.option(
    "--tolerance", type=FiniteRange(0, 1), default=0.01, show_default=True, metavar="D",
    help="How far from those of all effects events and frames may be with auto, as a distance.",
)  # fmt: skip
@click.option(
    "--budget", metavar="LIMIT[,LIMIT...]",
    help="Try settings on a short stretch first, on the CPU, and take the fastest within limits of error, such as"
    " vR=0.05 or us=50, and of time, such as time=10x (`vid2ev cost` shows all). What is given explicitly stays as it"
    " is.",
)  # fmt: skip
@click.option("--labels", is_flag=True, help="Store the cause of each event (signal, shot, leak, hot).")
@click.option(
    "--format", "formats", multiple=True, default=["hdf5"], show_default=True, metavar="NAME[,NAME...]",
    help="Event files to write, among them aedat4, evt3, dat, npz and csv.",
)  # fmt: skip
@click.option(
    "--frames-out", "frames", type=click.Choice(["npz", "png", "mp4"]), help="Write the events as frames, too."
)
@click.option(
    "--frames-by", default="duration:10ms", show_default=True, metavar="SLICES",
    help="What a frame holds: duration:10ms, count:50000, area:500,32, or source (from frame to frame).",
)  # fmt: skip
@click.option(
    "--frames-as", default="counts", show_default=True, metavar="KIND",
    help="counts, frame:2 (full scale), voxel:5 (bins), time-surface:30ms or sae.",
)  # fmt: skip
@click.option(
    "--probe", multiple=True, metavar="X,Y", help="Write the state of a pixel over time, as CSV and as a plot."
)
@click.option("--noise-maps", is_flag=True, help="Write each pixel's thresholds, and which are hot or cold.")
@click.option(
    "--cis-out", "pictures", multiple=True, default=["raw", "mp4"], show_default=True, metavar="KIND[,KIND...]",
    help="Frames of frame cameras: raw (codes of the ADC), png (8 bits), mp4.",
)  # fmt: skip
@click.option(
    "--truth", multiple=True, metavar="KIND[,KIND...]",
    help="What is known for certain: depth, mask, map (pixels in the other cameras), poses; of scenes also flow.",
)  # fmt: skip
@click.option(
    "--truth-rate",
    "truth_rate_hz",
    type=FiniteRange(0, min_open=True),
    default=30,
    show_default=True,
    metavar="HZ",
    help="How often.",
)
@click.option("--preview/--no-preview", default=True, help="Make preview.mp4.  [default: yes]")
@click.option("--overwrite", is_flag=True, help="Replace the folder if it is a recording.")
@click.option("--resume", is_flag=True, help="Go on where an interrupted conversion was.")
@click.option("--dry-run", is_flag=True, help="Check everything, say what would be done, do nothing.")
@click.option(
    "--json", "as_json", is_flag=True,
    help="Print JSON for programs: the manifest; of several, or with --jobs, what became of each.",
)  # fmt: skip
@click.option("-v", "--verbose", is_flag=True, help="Say what is going to be done, too.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def convert(
    videos: tuple[str, ...],
    output: str | None,
    dry_run: bool,
    verbose: bool,
    quiet: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Turn each VIDEO into the recording of an event camera.

    VIDEO is a video file, a folder of images (with timestamps.txt, or --fps), a .npy or .npz array, a photograph (with
    --motion), - for standard input, camera:0, scene:NAME (`vid2ev scene list`) or a scene file, synthetic:NAME, a
    folder of videos, or a list of videos, NAME.txt.  A recording is a folder with events.h5, preview.mp4 and
    manifest.json.

    Of several videos, one that fails does not stop the others; with --resume, those that are done are left as they are.
    """
    from vid2ev.commands import batch
    from vid2ev.commands.converting import check_shared, chosen_for, convert_on_worker, convert_one
    from vid2ev.commands.progress import given
    from vid2ev.commands.splitting import checked_for, split_among, split_of
    from vid2ev.commands.worker_options import workers_of
    from vid2ev.making import conversion
    from vid2ev.sources.many import sources_in

    quiet |= as_json
    workers = workers_of(options)
    split = split_of(options.pop("split"), workers)
    in_parts = split is not None and split.kind != "chain"
    if options["device"] == "cuda" and not quiet:
        _warn_without_gpu()
    options["seed"] = None if options["seed"] == "random" else options["seed"]
    found = [source for video in videos for source in sources_in(video)]
    single = len(videos) == 1 and found == [videos[0]] and not (output or "").endswith("/")
    directory = Path(output) if output and single else conversion.default_directory(videos[0])
    if single and workers.scheduler is None and workers.memory is None and split is None:
        made = convert_one(videos[0], directory, dry_run, verbose, quiet, options)
        if as_json:
            click.echo(json.dumps(made, indent=2))
        return

    if not workers.alone:
        options["threads"] = options["threads"] or workers.threads

    def each(video: str, directory: Path, others: bool) -> dict[str, Any]:
        if dry_run or in_parts:
            checked_for(workers, video, directory, split if in_parts else None, options)
        if split and in_parts and not dry_run:
            # (Effects that are found while a clip passes are not to be found in parts of it.)
            chosen = chosen_for(video, directory, quiet, dict(options), given() | {"effects auto"})
            return split_among(workers, video, directory, split, quiet, chosen, others)
        return convert_one(video, directory, dry_run, verbose, quiet, dict(options), others)

    directories = {videos[0]: directory} if single else batch.directories(found, Path(output or ""))
    if workers.alone or in_parts or dry_run:
        results = batch.convert_each(directories, each, quiet)
    else:
        check = partial(check_shared, overwrite=options["overwrite"], resume=options["resume"])
        # (What was checked is free, so that going on is beginning, and a task that is tried again goes on.)
        options["resume"] |= not options["overwrite"]
        link_s = 60 * split.number if split else math.inf
        task = partial(convert_on_worker, options=options, named=given(), link_s=link_s)
        results = batch.convert_shared(directories, task, check, workers, quiet)
    click.echo(
        json.dumps(results, indent=2) if as_json else batch.table(results) * (not quiet), nl=not quiet or as_json
    )
    sys.exit(batch.exit_code(results))


def _warn_without_gpu() -> None:
    """One line where a GPU is asked for and there is none."""
    from vid2ev.sensors.devices import missing_for_cuda

    if missing := missing_for_cuda():
        click.echo(f"device cuda: {missing}; converting on the CPU", err=True)
