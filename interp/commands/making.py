"""What commands that make films and folders of pictures have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from vid2ev.commands.options import Finite, adding
from vid2ev.errors import UsageError
from vid2ev.requests import number_of
from vid2ev.terminal import bar_of

SHORT_S, SLOW = 0.5, 30  # a film that is over before it is seen, and pictures per second that are seen


def what_options(output: str, play: str) -> Callable[..., Any]:
    """A decorator that adds to a command what is to be made; `output` and `play` are help texts."""
    return adding(
        click.option("-o", "--output", type=Path, metavar="FILE.mp4|DIR", help=output),
        click.option(
            "--format", type=click.Choice(["mp4", "png", "exr"]),
            help="A film, or a folder of PNG or of EXR (linear light).  [default: as the output's name says]",
        ),
        click.option("--play", metavar="RATE", help=play),
    )  # fmt: skip


def event_options(contrast: str) -> Callable[..., Any]:
    """A decorator that adds to a command what events are of; `contrast` is said of those without a recording's word."""
    return adding(
        click.option(
            "--contrast", metavar="C|OFF,ON",
            help=f"What an event stands for [nat].  [default: as the recording says, or {contrast}]",
        ),
        click.option(
            "--refractory", "refractory_us", type=Finite(), metavar="US",
            help="For how long a pixel is blind after an event, 0 for not at all: what it misses then is made good."
            "  [default: as the recording says, or else nothing is]",
        ),
    )  # fmt: skip


device_option = click.option(
    "--device", type=click.Choice(["cpu", "cuda", "auto"]), default="auto", show_default=True,
    help="Where; auto: on a GPU, if there is one.",
)  # fmt: skip


run_options = adding(  # what becomes of what is there, and what is printed
    click.option("--overwrite", is_flag=True, help="Replace what is there."),
    click.option("--resume", is_flag=True, help="Go on where an interrupted run was."),
    click.option("--json", "as_json", is_flag=True, help="Print the manifest as JSON for programs."),
    click.option("-q", "--quiet", is_flag=True, help="Print errors only."),
)


def film_text(made: Mapping[str, Any]) -> str:
    """How fast and how long the film of a manifest plays, and how it plays for longer where nobody would see it."""
    if not made["film_rate"]:
        return ""
    rate = float(Fraction(made["film_rate"]))
    seconds = made["frames"] / rate
    slower = f"; --play {SLOW} shows it slowly" if seconds < SHORT_S and rate > SLOW else ""
    return f", {rate:g} per second: {seconds:.3g} s{slower}"


def contrast_of(text: str | None) -> tuple[float, float] | None:
    """Nats of an OFF and an ON event as people write them.  Raises UsageError."""
    if text is None:
        return None
    from interp.representation.event_counts import MOST_NATS

    values = [number_of(word.strip()) for word in text.split(",")]
    if len(values) not in (1, 2) or not all(0 < value <= MOST_NATS for value in values):
        raise UsageError(
            f"--contrast {text}: expected nats, above 0 and at most {MOST_NATS:g}, such as 0.2, or of OFF and ON"
            " events, such as 0.2,0.25"
        )
    return values[0], values[-1]


@contextmanager
def bar(quiet: bool, bar_format: str, unit: str) -> Iterator[Callable[[int, int | None], None]]:
    """A progress bar: how much is done, of how much, how fast, and the time left."""
    with bar_of(quiet, bar_format, unit=unit) as shown:

        def report(done: int, total: int | None) -> None:
            if shown.total is None:
                shown.total, shown.initial, shown.n = total, done, done
            shown.update(done - shown.n)

        yield report
