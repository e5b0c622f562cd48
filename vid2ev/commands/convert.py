"""`vid2ev convert`: a video in, the recording of an event camera out."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands import INTERRUPTED
from vid2ev.errors import DataError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from vid2ev.conversion import Progress
    from vid2ev.recipe import Recipe

BAR = "{percentage:3.0f}% {bar} {n_fmt}/{total_fmt} frames, {elapsed} gone, {remaining} left{postfix}"


class Auto(click.ParamType):
    """A whole number from `least`, or one word."""

    def __init__(self, word: str, least: int, name: str):
        self.word, self.least, self.name = word, least, name

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return f"{self.word}|N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | str:
        if value == self.word or isinstance(value, int):
            return value
        try:
            number = int(value)
        except ValueError:
            self.fail(f"'{value}' is neither '{self.word}' nor a whole number", param, ctx)
        if number < self.least:
            self.fail(f"{number} is less than {self.least}", param, ctx)
        return number


@click.command(short_help="Turn a video into the recording of an event camera.")
@click.argument("video")
@click.option("-o", "--output", type=Path, metavar="DIR", help="Folder to make.  [default: NAME_events here]")
@click.option(
    "--sensor", default="paper", show_default=True, metavar="PRESET|FILE", help="`vid2ev sensors` lists them."
)
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of the sensor; may be repeated."
)
@click.option(
    "--upsample", type=click.Choice(["none", "linear", "flow"]), default="flow", show_default=True,
    help="Light between the frames: steps along a straight line in time, or along the estimated motion.",
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
@click.option(
    "--transfer",
    default="auto",
    show_default=True,
    metavar="CURVE",
    help="Codes to light: auto, srgb, bt709, pq, hlg, gamma:G, linear or another curve of the standards.",
)
@click.option(
    "--fps",
    type=click.FloatRange(0, min_open=True),
    metavar="RATE",
    help="Frames per second, instead of the source's own times.",
)
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
    help="Changes nothing but the time it takes.  [default: all cores]",
)
@click.option("--labels", is_flag=True, help="Store the cause of each event (signal, shot, leak, hot).")
@click.option("--preview/--no-preview", default=True, help="Make preview.mp4.  [default: yes]")
@click.option("--overwrite", is_flag=True, help="Replace the folder if it is a recording.")
@click.option("--resume", is_flag=True, help="Go on where an interrupted conversion was.")
@click.option("--dry-run", is_flag=True, help="Check everything, say what would be done, do nothing.")
@click.option("-v", "--verbose", is_flag=True, help="Say what is going to be done, too.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def convert(
    video: str,
    output: Path | None,
    dry_run: bool,
    verbose: bool,
    quiet: bool,
    overwrite: bool,
    resume: bool,
    **options: Any,
) -> None:
    """Turn VIDEO into the recording of an event camera.

    VIDEO is a video file, a folder of images (with timestamps.txt, or --fps), a .npy array, or synthetic:NAME.  The
    recording is a folder with events.h5, preview.mp4 and manifest.json.
    """
    from vid2ev import conversion
    from vid2ev.commands import summary

    directory = output or conversion.default_directory(video)
    options["seed"] = None if options["seed"] == "random" else options["seed"]
    if (dry_run or verbose) and not quiet:
        click.echo(_plan(video, directory, overwrite, resume, dict(options)))
    if dry_run:
        return
    with _kept(directory), _heard() as check, _bar(quiet, check) as report:
        manifest = conversion.convert(video, directory, overwrite=overwrite, resume=resume, report=report, **options)
    if not quiet:
        facts = [*summary.result_facts(manifest), *summary.file_facts(directory), *summary.speed_facts(manifest)]
        click.echo(summary.lines(facts))


def _plan(video: str, directory: Path, overwrite: bool, resume: bool, options: dict[str, Any]) -> str:
    """What a conversion would do; raises what it would raise before its first frame."""
    from vid2ev.commands import summary
    from vid2ev.recipe import Recipe
    from vid2ev.recording.folder import check_free

    threads, preview, seed = options.pop("threads"), options.pop("preview"), options.pop("seed")
    recipe = Recipe.of(video, seed=seed or 0, **options)
    check_free(directory, overwrite, resume)
    files = f"events.h5, {'preview.mp4, ' * preview}manifest.json"
    described = recipe.describe() | {"seed": "drawn at random" if seed is None else seed}
    facts = [*summary.recipe_facts(described), ("output", f"{directory}: {files}")]
    return summary.lines([*facts, *([("threads", str(threads))] if threads else [])])


@contextmanager
def _kept(directory: Path) -> Iterator[None]:
    """What goes wrong within says so if it can be resumed."""
    from vid2ev.recording.folder import partial_of

    try:
        yield
    except (DataError, KeyboardInterrupt) as error:
        kept = (partial_of(directory) / "checkpoint.npz").exists()
        remedy = (
            "; what is done is kept, the same command with --resume goes on" if kept else "; nothing is left behind"
        )
        if isinstance(error, DataError):
            raise DataError(f"{error}{remedy * kept}") from error
        click.echo(f"interrupted{remedy}", err=True)
        sys.exit(INTERRUPTED)


@contextmanager
def _heard() -> Iterator[Callable[[], None]]:
    """Ctrl-C counts even where Python loses it, as in a callback of compiled code: what this yields raises it anew."""
    asked = False

    def note(*_: Any) -> None:
        nonlocal asked
        asked = True
        raise KeyboardInterrupt

    def check() -> None:
        if asked:
            raise KeyboardInterrupt

    def tell(lost: Any) -> None:
        if lost.exc_type is not KeyboardInterrupt:  # that one is not lost
            tell_before(lost)

    if threading.current_thread() is not threading.main_thread():
        yield check
        return
    before, tell_before = signal.signal(signal.SIGINT, note), sys.unraisablehook
    sys.unraisablehook = tell
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
        sys.unraisablehook = tell_before


@contextmanager
def _bar(quiet: bool, check: Callable[[], None]) -> Iterator[Callable[[Recipe, Progress], None]]:
    """A progress bar on a terminal: frames, time left, events per second, and speed against real time."""
    from tqdm import tqdm

    bar: tqdm | None = None

    def report(recipe: Recipe, done: Progress) -> None:
        nonlocal bar
        check()
        if bar is None:
            total, first = recipe.source.frames_expected, done.frames - 1
            bar = tqdm(total=total, initial=first, bar_format=BAR, leave=False, disable=quiet or None)
        speed, video_s = done.seconds or 1.0, (done.end_ns - done.start_ns) / 1e9
        bar.set_postfix_str(f"{done.events / speed:,.0f} events/s, {video_s / speed:.2g} x real time", refresh=False)
        bar.update(done.frames - bar.n)

    try:
        yield report
    finally:
        if bar is not None:
            bar.refresh()
            bar.close()
