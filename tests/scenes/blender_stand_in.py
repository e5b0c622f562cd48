"""What stands in for Blender in tests: a plain renderer of the exchange, by its description alone.

    stand_in.py DIARY MODE ...    MODE: well; fails, dies or lies in some way

Triangles are met one by one; light is albedo times the thing's own, and every lamp adds its colour everywhere.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import numpy as np
import OpenEXR


def main() -> None:
    diary, mode = Path(sys.argv[1]), sys.argv[2]
    note(diary, "started")
    if mode == "no-start":
        sys.exit("libGL is not there\nthis Blender does not start")
    if mode == "no-module":
        print("Traceback of something\nModuleNotFoundError: No module named 'that'\n\nBlender quit")
        sys.exit(1)
    print(f"Blender of someone else\nvid2ev: {'3.4.1' if mode == 'old' else '5.0 of tests'}", flush=True)
    for count, line in enumerate(sys.stdin):
        if mode == "dies" or (mode == "dies-later" and count >= 2):
            sys.stderr.write("Traceback of something\nMemoryError: the scene is too large\n")
            sys.exit(3)
        if mode == "crashes":
            os.kill(os.getpid(), signal.SIGKILL)
        path = Path(line.rstrip("\n"))
        request = json.loads(path.read_text())
        for asked in request["passes"]:
            if not (path.parent / asked["answer"]).exists():
                note(diary, asked["kind"])
                write(path.parent / asked["answer"], answer(request, asked, path.parent), mode)
        print("Fra:1 Mem:8.00M\nvid2ev: done", flush=True)


def note(diary: Path, word: str) -> None:
    with open(diary, "a") as file:
        file.write(f"{word}\n")


def write(path: Path, channels: dict[str, np.ndarray], mode: str) -> None:
    if mode == "garbage":
        path.write_bytes(b"v/1\x01 no picture")
        return
    if mode == "small":
        channels = {name: pixels[:-1] for name, pixels in channels.items()}
    if mode == "too-many":
        channels = {name: pixels + 100 for name, pixels in channels.items()}
    if mode == "no-index":
        channels = {name: pixels for name, pixels in channels.items() if "Index" not in name}
    pixels = {f"ViewLayer.{name}": np.ascontiguousarray(value, np.float32) for name, value in channels.items()}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, pixels).write(str(path))


def answer(request: dict, asked: dict, folder: Path) -> dict[str, np.ndarray]:
    (width, height), focal, centre = request["size"], np.array(request["focal_px"]), np.array(request["centre_px"])
    px = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    rays = np.concatenate([(px - centre) / focal, np.ones((len(px), 1))], axis=1)
    depth, index = np.full(len(px), 1e10), np.zeros(len(px))
    light = np.tile(request["sky"]["light"], (len(px), 1)) * asked["around"]
    for number, thing in enumerate(request["things"], 1):
        z, colour = meet(rays, thing, folder)
        nearer = z < depth
        depth[nearer], index[nearer] = z[nearer], number
        light[nearer] = (colour * thing["colour"] * thing["light"])[nearer] * asked["around"]
    for lamp in asked["lamps"]:
        light += request["lamps"][lamp]["colour"]
    shaped = [value.reshape(height, width) for value in (depth, index, *light.T)]
    if asked["kind"] == "geometry":
        return {"Depth.Z": shaped[0], "Object Index.X": shaped[1]}
    return {f"Combined.{name}": channel for name, channel in zip("RGB", shaped[2:], strict=True)}


def meet(rays: np.ndarray, thing: dict, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Depth [n] and colour [n, 3] of the first meeting of each ray."""
    arrays, pose = np.load(folder / thing["mesh"]), np.array(thing["pose"])
    spots = (arrays["vertices"] @ pose[:3, :3].T + pose[:3, 3])[arrays["triangles"].astype(int)]
    origin, e1, e2 = spots[:, 0], spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0]
    h = np.cross(rays[:, None], e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = 1 / np.einsum("ntk,tk->nt", h, e1)
        u = f * np.einsum("ntk,tk->nt", h, -origin)
        q = np.cross(-origin, e1)
        v, t = f * np.einsum("nk,tk->nt", rays, q), f * np.einsum("tk,tk->t", e2, q)
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    t = np.where(hit, t, np.inf)
    first, row = t.argmin(axis=1), np.arange(len(rays))
    share = np.stack([1 - u - v, u, v], axis=-1)[row, first]
    z = t[row, first]
    if thing["texture"] is None:
        return z, np.ones((len(rays), 3))
    uv = np.einsum("nk,nkc->nc", np.nan_to_num(share), arrays["uv"][first])
    return z, texel(np.load(folder / thing["texture"]), uv * thing["scale"] + thing["offset"])


def texel(pixels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Between four texels of a picture that repeats, v up."""
    height, width = pixels.shape[:2]
    x, y = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, down = (x - left)[:, None], (y - top)[:, None]
    rows = [
        (1 - right) * pixels[y_ % height, left % width] + right * pixels[y_ % height, (left + 1) % width]
        for y_ in (top, top + 1)
    ]
    return (1 - down) * rows[0] + down * rows[1]


if __name__ == "__main__":
    main()
