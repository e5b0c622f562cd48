"""`vid2ev interpolate`: the high-frame-rate video of a recording, or of any video."""

from __future__ import annotations

import json
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interp import pretrained
from interp.commands.making import (
    bar,
    contrast_of,
    device_option,
    event_options,
    film_text,
    run_options,
    what_options,
)
from vid2ev.commands.options import Finite
from vid2ev.commands.worker_options import worker_options

if TYPE_CHECKING:
    from interp.interpolate.take import Options
    from vid2ev.cluster.task import Tell
    from vid2ev.cluster.workers import Workers

FRAMES = "{percentage:3.0f}% {bar} {n_fmt}/{total_fmt} frames, {rate_fmt}, {elapsed} gone, {remaining} left"


@click.command(short_help="Make the high-frame-rate video of a recording or a video.")
@click.argument("sources", nargs=-1, required=True, metavar="SOURCE...")
@click.option(
    "-x", "multiple", metavar="N", help="So many times the frames: 32, 2.5.  [default: 8, unless there is --fps]"
)
@click.option("--fps", metavar="RATE", help="Frames per second of the scene's time: 960, 30000/1001.")
@click.option(
    "--method", metavar="NAME", help="nearest, linear, flow, or with events integration, both, bridge, ramps, guided;"
    " of a single frame deblur or integration.  [default: with events the network that comes with vid2ev; flow"
    " without; of a single frame deblur]",
)  # fmt: skip
@click.option("--network", metavar="WEIGHTS", help="Of `vid2ev train`, or the name of some that come with vid2ev.")
@click.option(
    "--hdr", is_flag=True,
    help="Give all frames, key frames too, the range that events show, by the weights for it that come with vid2ev.",
)  # fmt: skip
@click.option("--hdr-network", metavar="WEIGHTS", help="The same, by weights of `vid2ev train --network hdr`.")
@what_options(
    output="What to make; of several sources the folder for all.  [default: NAME_x8.mp4 here]",
    play="Frames per second of the film: 30 is slow motion.  [default: real time]",
)
@click.option(
    "--events", type=click.Path(exists=True, path_type=Path), metavar="EVENTS",
    help="Event file to one video, images or a single frame, on their clock.",
)  # fmt: skip
@click.option(
    "--start",
    type=Finite(),
    metavar="S",
    help="Begin at the first frame from this second on; of recordings after the first frame.",
)
@click.option("--stop", type=Finite(), metavar="S", help="End at the last frame up to there.")
@click.option("--crop", metavar="WxH+X+Y", help="Part of a video's picture, and of events of as many pixels.")
@click.option("--size", metavar="W|WxH|WxH!", help="Pixels to bring a video to.")
@click.option("--transfer", default="auto", show_default=True, metavar="CURVE", help="Of a video's codes.")
@click.option("--source-fps", metavar="RATE", help="Of images or a video, instead of their own times.")
@event_options(contrast="else what fits the frames")
@click.option(
    "--tile", default="auto", show_default=True, metavar="WxH|auto|none",
    help="Pixels made at a time; auto: all of frames of up to a million, tiles of about as many of larger ones.",
)  # fmt: skip
@click.option(
    "--cuts", type=click.Choice(["hold", "keep"]), default="hold", show_default=True,
    help="At a cut hold the nearest frame, or interpolate as anywhere.",
)  # fmt: skip
@device_option
@click.option(
    "--precision", type=click.Choice(["float32", "bfloat16", "float16"]), default="float32", show_default=True,
    help="Of a network's convolutions, but not of HDR's: fewer bits are faster where hardware has them; `vid2ev cost"
    " SOURCE --rebuild 8` says what that does here.",
)  # fmt: skip
@click.option(
    "--compile", "compiled", is_flag=True, help="Have torch compile a network first, for long footage; not that of HDR."
)
@worker_options("Sources")
@run_options
def interpolate(sources: tuple[str, ...], output: Path | None, as_json: bool, quiet: bool, **options: Any) -> None:
    """Make the frames of each SOURCE at more instants: a recording of `vid2ev convert`, in the layout of HS-ERGB or
    BS-ERGB, an event file with frames, a video, or a folder of images; also a single frame with its events (--events,
    or NAME.mat beside NAME.png); or all recordings in a folder, or where there are none its videos and folders of
    images; or all of these in a list, NAME.txt.

    Frames of the source stay as they are, and nothing is interpolated across a cut.  Instants are whole microseconds on
    an exact grid.  A folder has timestamps.txt, so that `vid2ev convert` reads it again.
    """
    from interp.commands.many import places, sources_in
    from interp.interpolate.take import Options
    from interp.methods.running import Running
    from vid2ev.commands import batch
    from vid2ev.commands.worker_options import workers_of
    from vid2ev.errors import UsageError

    quiet |= as_json
    workers = workers_of(options)
    asked, given = options.pop("hdr"), options.pop("hdr_network")
    options["hdr"] = given or (pretrained.first(pretrained.HDR) if asked else None)
    options["running"] = Running(options.pop("precision"), options.pop("compiled"))
    taken = Options(
        start_s=options.pop("start"),
        stop_s=options.pop("stop"),
        crop=options.pop("crop"),
        size=options.pop("size"),
        transfer=options.pop("transfer"),
        source_hz=_number(options.pop("source_fps"), "--source-fps"),
        contrast=contrast_of(options.pop("contrast")),
        refractory_us=options.pop("refractory_us"),
        events=options.pop("events"),
    )
    found = [each for source in sources for each in sources_in(source, output or Path())]
    single = found == [*sources] and len(found) == 1
    if single and workers.scheduler is None:
        made = _one(found[0], output or _default(found[0], options), quiet=quiet, taken=taken, options=options)
        if as_json:
            click.echo(json.dumps(made, indent=2))
        return
    if output and output.suffix.lower() == ".mp4" and not output.is_dir() and not single:
        raise UsageError(
            f"-o {output}: a film, of {len(found)} source(s) in {sources[0]}; expected the name of a folder"
        )
    if taken.events and len(found) > 1:
        raise UsageError(f"--events {taken.events}: of one source, and here are {len(found)}; give each its own")
    if output and single:
        paths = {found[0]: output}
    else:
        paths = places(found, output or Path(), lambda source: _default(source, options))

    one = partial(_one, quiet=quiet, taken=taken, options=options)
    shared = partial(_shared, paths, workers, quiet, taken, options)
    results = batch.convert_each(paths, one, quiet) if workers.alone else shared()
    if not quiet or as_json:
        click.echo(json.dumps(results, indent=2) if as_json else batch.table(results))
    sys.exit(batch.exit_code(results))


def _one(
    source: str, path: Path, others: bool = False, *, quiet: bool, taken: Options, options: dict[str, Any]
) -> dict[str, Any]:
    """Interpolate a source, `others` perhaps being done already; returns the manifest."""
    from interp.interpolate.whole import interpolate as make
    from vid2ev.commands.progress import kept
    from vid2ev.interrupts import heard
    from vid2ev.terminal import lines

    tell = None if quiet else lambda text: click.echo(f"by {text}")
    with kept(path, "done.jsonl", others=others), heard(), bar(quiet, FRAMES, " frames") as report:
        made = make(source, path, options=taken, report=report, told=tell, **options)
    if not quiet:
        click.echo(lines(_facts(path, made)))
    return made


def _shared(
    paths: dict[str, Path], workers: Workers, quiet: bool, taken: Options, options: dict[str, Any]
) -> list[dict[str, Any]]:
    """Interpolate sources by workers."""
    from interp.interpolate.destination import check_free, kind_of
    from vid2ev.commands import batch

    def check(_: str, path: Path) -> None:
        check_free(path, kind_of(path, options["format"]), options["overwrite"], options["resume"])

    # (What was checked is free, so that going on is beginning, and a task that is tried again goes on.)
    goes_on = options | {"resume": options["resume"] or not options["overwrite"]}
    return batch.convert_shared(paths, partial(_on_worker, taken=taken, options=goes_on), check, workers, quiet)


def _on_worker(tell: Tell, video: str, directory: Path, taken: Options, options: dict[str, Any]) -> dict[str, Any]:
    """Interpolate a source, as a task; returns the manifest."""
    from interp.interpolate.whole import interpolate as make
    from vid2ev.cluster.task import share_of

    def report(done: int, total: int | None) -> None:
        tell(share_of(done, total))

    return make(video, directory, options=taken, report=report, **options)


def _default(source: str, options: dict[str, Any]) -> Path:
    path = Path(os.path.abspath(source))
    many = f"{options['fps']}fps" if options["fps"] else f"x{options['multiple'] or 8}"
    name = f"{path.name if path.is_dir() else path.stem}_{many}".replace("/", "_")
    return Path(name if options["format"] in ("png", "exr") else f"{name}.mp4")


def _number(text: str | None, option: str) -> Any:
    from interp.interpolate.instants import parse_number

    return None if text is None else parse_number(text, option)


def _facts(path: Path, made: dict[str, Any]) -> list[tuple[str, str]]:
    from interp.methods import METHODS
    from vid2ev.terminal import counted

    (width, height), kind = made["size"], made["format"].partition(" ")[0]
    facts = [("made", f"{path}: {counted(made['frames'], 'frame')} of {width}x{height} as {kind}{film_text(made)}")]
    span_s = (made["stop_us"] - made["start_us"]) / 1e6
    facts.append(("from", f"{counted(made['key_frames'], 'key frame')}, {span_s:.6g} s"))
    if made["hdr"]:
        facts.append(("hdr", f"all frames, by {pretrained.name_of(Path(made['hdr']['weights']))}"))
    method = made["interpolation"]["method"]  # (of closed forms, most take no tiles)
    in_tiles = method not in METHODS or getattr(METHODS[method](), "in_tiles", False)
    if made["tiles"] != "none" and (made["hdr"] or in_tiles):
        facts.append(("tiles", made["tiles"]))
    for reason, gaps in made["gaps_s"].items():
        first = f", the first at {gaps[0][0]:.6g} s"
        many = counted(len(gaps), "gap")
        facts.append(("held", f"{many} not interpolated as asked, because of {reason}{first}"))
    run = made["run"]
    facts.append(("speed", f"{run['frames'] / max(run['seconds'], 1e-9):.3g} frames/s, {run['seconds']:.3g} s"))
    return [*facts, *(("warning", text) for text in made["remarks"])]
