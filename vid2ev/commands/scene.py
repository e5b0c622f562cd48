"""`vid2ev scene`: list the predefined scenes, or render one, or many of one kind."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands.options import FiniteRange, Rate
from vid2ev.interrupts import heard

if TYPE_CHECKING:
    from collections.abc import Iterator

    from vid2ev.scenes.blender.renderer import Cycles
    from vid2ev.scenes.camera_folder import Contents
    from vid2ev.scenes.scene_file import SceneFile

FRAMES = "{desc}: {percentage:3.0f}% {bar} {n_fmt}/{total_fmt} frames, {rate_fmt}, {elapsed} gone, {remaining} left"


@click.command(short_help="List the predefined scenes, or render one with depth, flow and poses.")
@click.argument("name")
@click.option("-o", "--output", type=Path, metavar="DIR", help="Where to write.  [default: NAME_scene here]")
@click.option(
    "--count", type=click.IntRange(1, 10**6), metavar="N", help="Many: seeds S ... S+N-1, into DIR/NAME-SEED/."
)
@click.option("--seed", type=click.IntRange(0, 1 << 62), default=0, show_default=True, help="Which of all such scenes.")
@click.option(
    "--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change the scene: duration_s=1, objects.box.count=5."
)
@click.option("--size", metavar="WxH", help="Pixels of the reference camera.")
@click.option("--duration", type=FiniteRange(0, 1e5, min_open=True), metavar="S", help="Seconds of the scene.")
@click.option(
    "--fps",
    type=Rate(1e6),
    metavar="RATE",
    help="Frames per second.  [default: as many as motion and light ask for]",
)
@click.option(
    "--frames",
    type=click.Choice(["png", "png16", "tiff", "exr"]),
    default="png",
    show_default=True,
    help="png and png16: sRGB; tiff and exr: linear light, unclipped.",
)
@click.option(
    "--truth", default="poses", show_default=True, metavar="LIST",
    help="depth, flow, poses; depth:exr or depth:png (16 bits: m per code in depth.txt, 0 unknown, 65535 infinitely"
    " far), flow:flo or flow:png; none.",
)  # fmt: skip
@click.option(
    "--renderer",
    type=click.Choice(["embedded", "blender"]),
    default="embedded",
    show_default=True,
    help="blender: Cycles, by a Blender that is installed; slower.",
)
@click.option("--samples", type=click.IntRange(1, 1 << 16), metavar="N", help="Of a pixel, by Cycles.  [default: 32]")
@click.option("--blender", metavar="PROGRAM", help="Blender.  [default: $VID2EV_BLENDER, or blender on the PATH]")
@click.option("--preview/--no-preview", default=True, help="Make preview.mp4.  [default: yes]")
@click.option("--overwrite", is_flag=True, help="Replace scenes that are there.")
@click.option("--resume", is_flag=True, help="Leave scenes that are there, and go on with those that are not.")
@click.option("--dry-run", is_flag=True, help="Print the scene with every number settled, and do nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@heard()
def scene(name: str, dry_run: bool, as_json: bool, quiet: bool, **options: Any) -> None:
    """`vid2ev scene list` says which scenes there are; `vid2ev scene NAME` renders one of them, or a scene file.

    The folder holds the frames with their times, and `vid2ev convert DIR` makes events of them.  Exacter and quicker,
    `vid2ev convert scene:NAME` renders and converts at once, without codes and rounding in between.
    """
    if name == "list":
        titles = _titles()
        click.echo(json.dumps(titles, indent=2) if as_json else _listing(titles))
        return
    from vid2ev.toml_text import toml_text

    file, contents = _file(name, options), _contents(options)
    _check_renderer(options)
    if dry_run:
        from vid2ev.scenes.own_files import named_from

        tables = named_from(file.resolved(options["seed"]).tables(), Path())
        click.echo(json.dumps(tables, indent=2) + "\n" if as_json else toml_text(tables), nl=False)
        return
    made = list(_render(file, contents, options, quiet or as_json))
    if as_json:
        click.echo(json.dumps(made, indent=2))


def _titles() -> dict[str, str]:
    from vid2ev.scenes.scene_file import read_scene, scene_names

    return {name: read_scene(name).title() for name in scene_names()}


def _listing(titles: dict[str, str]) -> str:
    width = max(map(len, titles))
    lines = [f"{name:<{width}}  {title}" for name, title in titles.items()]
    return "\n".join([*lines, "", "Render one: vid2ev scene NAME.  Events of one: vid2ev convert scene:NAME"])


def _file(name: str, options: dict[str, Any]) -> SceneFile:
    """The scene file with its settings; what is wrong with it is said at once."""
    from vid2ev.commands.progress import given
    from vid2ev.errors import UsageError
    from vid2ev.scenes.scene_file import plain_size, read_scene
    from vid2ev.scenes.source import parse_request
    from vid2ev.sources import SCENE_PREFIX

    request = parse_request(name.removeprefix(SCENE_PREFIX))  # (as `convert` takes it)
    options["seed"] = options["seed"] if "seed" in given() else request.seed
    settings = [*request.settings, *(plain_size(setting) for setting in options["settings"])]
    if options["size"]:
        settings.append(plain_size(f"size={options['size']}"))
        if settings[-1].startswith("size"):
            raise UsageError(f"size '{options['size']}': expected WIDTHxHEIGHT, such as 640x480")
    if options["duration"]:
        settings.append(f"duration_s={options['duration']}")
    return read_scene(request.name, settings)


def _contents(options: dict[str, Any]) -> Contents:
    from vid2ev.scenes.camera_folder import Contents

    truth = () if options["truth"] == "none" else tuple(options["truth"].split(","))
    return Contents(options["frames"], truth, options["preview"])


def _render(file: SceneFile, contents: Contents, options: dict[str, Any], quiet: bool) -> Iterator[dict[str, Any]]:
    from vid2ev.scenes.folder import write_scene
    from vid2ev.scenes.source import SceneSource
    from vid2ev.scenes.world import World
    from vid2ev.terminal import counted, counting

    stem, seed, count = Path(file.name).stem, options["seed"], options["count"]
    output = options["output"] or Path(f"{stem}_scene" + "s" * (count is not None))
    directories = (
        {seed: output} if count is None else {s: output / f"{stem}-{s:04d}" for s in range(seed, seed + count)}
    )
    keep = {"overwrite": options["overwrite"], "resume": options["resume"]}
    for seed, directory in directories.items():
        with _renderer(directory, options) as renderer, counting(quiet, FRAMES, desc=str(directory)) as report:
            source = SceneSource(World(file, seed, renderer=renderer), file.name, seed=seed, fps=options["fps"])
            often = f"{float(options['fps']):.12g} fps" if options["fps"] else "all instants"
            how = f"{file.name}, seed {seed}, {often}"
            how += f", Cycles with {counted(renderer.samples, 'sample')}" if renderer else ""
            new = write_scene(directory, source, contents, how, report=report, **keep)
        frames, seconds = len(source.instants), source.duration_expected_s
        if not quiet:
            what = f"{counted(frames, 'frame')}, {seconds:.3g} s, seed {seed}" if new else "is there already"
            click.echo(f"{directory}: {what}")
            if renderer and renderer.describe():
                click.echo(f"{directory}: {renderer.describe()}")
            for warning in source.warnings:
                click.echo(f"warning: {warning}")
        yield {"directory": str(directory), "seed": seed, "frames": frames, "duration_s": seconds, "new": new}


def _check_renderer(options: dict[str, Any]) -> None:
    """Raise UsageError for a renderer that is not there, and for options that say nothing to it."""
    from vid2ev.errors import UsageError

    if options["renderer"] == "blender":
        from vid2ev.scenes.blender.program import find_blender

        find_blender(options["blender"])
        return
    for name in ("samples", "blender"):
        if options[name] is not None:
            raise UsageError(f"--{name} {options[name]} says nothing to the embedded renderer; add --renderer blender")


def _renderer(directory: Path, options: dict[str, Any]) -> AbstractContextManager[Cycles | None]:
    """Cycles for a folder, or None for the embedded renderer."""
    if options["renderer"] != "blender":
        return nullcontext()
    from vid2ev.scenes.blender.renderer import renderer_beside

    return renderer_beside(directory, options["samples"], options["blender"])
