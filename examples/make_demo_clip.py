"""Make `demo.mp4`: a camera slides past photographs that hang at different distances before a wall of pebbles.

    python examples/make_demo_clip.py [OUTPUT]

The photographs are the ones scikit-image ships (public domain and CC0).  Nearer ones move faster (parallax), cover and
uncover what is behind them, and the shutter is open for a quarter of the frame time.  The same versions of the
libraries give the same file; nothing is random.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import av
import click
import cv2
import numpy as np
from skimage import data

WIDTH, HEIGHT, FPS, SECONDS = 640, 480, 30, 3
SHUTTER_S = 0.25 / FPS
SHUTTER_SAMPLES = 5
SLIDE = 360.0  # px that something at distance 1 moves in all
RISE = 24.0


class Print(NamedTuple):
    """A photograph in space; it is drawn at `centre` [px] when the camera is in the middle of its path."""

    light: np.ndarray  # [h, w, 3] linear light, blue green red
    cover: np.ndarray  # [h, w] 0 transparent ... 1 opaque
    centre: tuple[float, float]
    distance: float


@click.command(help=__doc__.split("\n\n")[0] if __doc__ else None)
@click.argument("output", type=click.Path(dir_okay=False, path_type=Path), default=Path(__file__).with_name("demo.mp4"))
def main(output: Path) -> None:
    prints = scene()
    with av.open(f"file:{output}", "w", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=FPS, options={"crf": "18", "preset": "slow", "threads": "1"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        context = stream.codec_context
        context.color_range, context.colorspace, context.color_primaries, context.color_trc = 1, 1, 1, 1
        for k in range(FPS * SECONDS):
            frame = av.VideoFrame.from_ndarray(coded(picture(prints, k)), "bgr24").reformat(
                format="yuv420p", dst_colorspace="ITU709"
            )
            frame.pts = k
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def scene() -> list[Print]:
    """The wall and the photographs, far ones first."""
    wall = np.pad(data.gravel(), ((64, 64), (160, 160)), mode="symmetric")
    return [
        opaque(cv2.merge([wall, wall, wall]), (320, 240), distance=3.0),
        framed(data.rocket(), 190, (140, 130), distance=2.2),
        framed(data.chelsea(), 170, (500, 150), distance=1.8),
        framed(data.coffee(), 190, (200, 350), distance=1.4),
        oval(data.astronaut()[0:330, 60:390], 250, (450, 320), distance=1.0),
    ]


def picture(prints: list[Print], k: int) -> np.ndarray:
    """Light [H, W, 3] of frame k: the mean of what the camera sees while its shutter is open."""
    instants = [k / FPS + SHUTTER_S * (i + 0.5) / SHUTTER_SAMPLES for i in range(SHUTTER_SAMPLES)]
    return np.mean([view(prints, t) for t in instants], axis=0)


def view(prints: list[Print], t: float) -> np.ndarray:
    """Light [H, W, 3] that the camera sees at t [s]."""
    along = -0.5 * math.cos(math.pi * t / SECONDS)  # -0.5 ... 0.5, starting and ending at rest
    seen = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for thing in prints:
        height, width = thing.cover.shape
        left = thing.centre[0] - width / 2 - SLIDE * along / thing.distance
        top = thing.centre[1] - height / 2 - RISE * math.sin(2 * math.pi * t / SECONDS) / thing.distance
        place = np.float32([[1, 0, left], [0, 1, top]])
        cover = cv2.warpAffine(thing.cover, place, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)[..., None]
        light = cv2.warpAffine(thing.light, place, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)
        seen += cover * (light - seen)
    return seen


def opaque(codes: np.ndarray, centre: tuple[float, float], distance: float) -> Print:
    light = (np.float32(codes) / 255) ** np.float32(2.2)
    return Print(light, np.ones(codes.shape[:2], np.float32), centre, distance)


def framed(photograph: np.ndarray, height: int, centre: tuple[float, float], distance: float) -> Print:
    """The photograph with a white border and edges a pixel soft."""
    codes = cv2.copyMakeBorder(scaled(photograph, height), 8, 8, 8, 8, cv2.BORDER_CONSTANT, value=(235,) * 3)
    cover = cv2.copyMakeBorder(np.ones(codes.shape[:2], np.float32), 3, 3, 3, 3, cv2.BORDER_CONSTANT, value=0)
    codes = cv2.copyMakeBorder(codes, 3, 3, 3, 3, cv2.BORDER_REPLICATE)
    return opaque(codes, centre, distance)._replace(cover=cv2.GaussianBlur(cover, (0, 0), 0.7))


def oval(photograph: np.ndarray, height: int, centre: tuple[float, float], distance: float) -> Print:
    """The photograph cut out along an ellipse."""
    codes = scaled(photograph, height)
    rows, columns = np.indices(codes.shape[:2], np.float32)
    middle_y, middle_x = (codes.shape[0] - 1) / 2, (codes.shape[1] - 1) / 2
    radius = np.hypot((rows - middle_y) / (middle_y - 4), (columns - middle_x) / (middle_x - 4))
    cover = np.clip((1 - radius) * middle_x / 2 + 0.5, 0, 1).astype(np.float32)
    return opaque(codes, centre, distance)._replace(cover=cover)


def scaled(photograph: np.ndarray, height: int) -> np.ndarray:
    """The photograph as blue, green, red codes of this height."""
    width = round(photograph.shape[1] * height / photograph.shape[0])
    return cv2.resize(photograph[..., ::-1], (width, height), interpolation=cv2.INTER_AREA)


def coded(light: np.ndarray) -> np.ndarray:
    """8-bit codes of the curve of BT.709."""
    signal = np.where(light < 0.018, 4.5 * light, 1.099 * np.maximum(light, 0) ** 0.45 - 0.099)
    return np.rint(255 * np.clip(signal, 0, 1)).astype(np.uint8)


if __name__ == "__main__":
    main()
