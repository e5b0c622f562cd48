"""The options that say how a source is read, and what cameras look at it, the same for every command that has them."""

from __future__ import annotations

import click

from vid2ev.commands.options import Finite, FiniteRange, Rate, adding

source_options = adding(  # those of `open_source`
    click.option(
        "--transfer",
        default="auto",
        show_default=True,
        metavar="CURVE",
        help="Codes to light: auto, srgb, bt709, pq, hlg, gamma:G, linear or another curve of the standards;"
        " linear:10bit of a sensor's codes that do not fill 16 bits.",
    ),
    click.option(
        "--fps",
        type=Rate(),
        metavar="RATE",
        help="Frames per second, instead of the source's own times: 25, 30000/1001.",
    ),
    click.option("--start", type=Finite(), metavar="S", help="Begin at this second of the source's own clock."),
    click.option("--stop", type=Finite(), metavar="S", help="End there."),
    click.option(
        "--slowdown",
        type=FiniteRange(0, min_open=True),
        metavar="F",
        help="The footage plays F times slower than the world went: 8 for 240 fps that play at 30.",
    ),
    click.option("--crop", metavar="WxH+X+Y", help="Part of the picture; WxH is the middle."),
    click.option(
        "--size",
        metavar="W|WxH|WxH!",
        help="Pixels to bring it to: the largest part of that shape, or with ! all of it.",
    ),
    click.option(
        "--motion",
        metavar="MOTION",
        help="Move a camera over a photograph: pan, saccade, zoom (pan:speed=200,angle=30) or a file PATH.csv.",
    ),
)


camera_options = adding(  # of `convert`, for commands that write no recording
    click.option("--sensor", default="paper", show_default=True, metavar="PRESET|FILE", help="As for convert."),
    click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of the sensor."),
    click.option("--rig", metavar="FILE", type=click.Path(dir_okay=False), help="Cameras around the source's."),
    click.option("--depth", metavar="DEPTH", help="How far the scene is, for cameras that stand elsewhere."),
    click.option("--frames", "frame_camera", is_flag=True, help="A frame camera, too, in the same place."),
    click.option("--cis", metavar="PRESET|FILE", help="Sensor of frame cameras; without a rig, as --frames."),
)
