"""Damaged files of every kind: frames with warnings or one sentence, never a crash, never without end.

Each damaged file is read in a process of its own kind of death: the readers under test are other people's C code, and
what kills the process must fail the test, not end it.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile

from vid2ev.errors import DataError, UsageError
from vid2ev.sources import open_source

MOST_FRAMES = 5000
LONGEST_S = 60


def noise(count: int, shape: tuple[int, int] = (48, 64)) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    base = rng.integers(0, 128, shape)
    return [(base + rng.integers(0, 64, shape) + k).astype(np.uint8) for k in range(count)]


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """The file after one of the accidents that happen to files."""
    spoilt = bytearray(data)
    at = int(rng.integers(0, len(spoilt)))
    if rng.random() < 0.5:  # (half of the accidents hit the first and last kilobyte, where the structure is)
        near = int(rng.integers(0, min(1024, len(spoilt))))
        at = near if rng.random() < 0.5 else len(spoilt) - 1 - near
    match int(rng.integers(0, 6)):
        case 0:
            spoilt[at] ^= 1 << int(rng.integers(0, 8))
        case 1:
            del spoilt[at:]
        case 2:
            del spoilt[at : at + int(rng.integers(1, 200))]
        case 3:
            spoilt[at : at + 40] = rng.integers(0, 256, 40).astype(np.uint8).tobytes()
        case 4:
            spoilt[at : at + 8] = b"\xff" * 8
        case _:
            spoilt[at:at] = spoilt[at // 2 : at // 2 + int(rng.integers(1, 500))]
    return bytes(spoilt)


def outcome(path: Path, options: dict[str, object]) -> str:
    """How reading the file ends: how many frames, the sentence of an error, or what should not have happened."""
    try:
        source = open_source(path, **options)  # type: ignore[arg-type]
        last_ns, count = None, 0
        for frame in source.frames():
            if frame.light.shape[:2] != source.size[::-1] or frame.light.dtype != np.float32:
                return f"BAD shape {frame.light.shape}"
            if last_ns is not None and frame.t_ns <= last_ns:
                return f"BAD times {last_ns} {frame.t_ns}"
            last_ns, count = frame.t_ns, count + 1
            if count > MOST_FRAMES:
                return "BAD without end"
        return f"{count} frames {source.warnings}"
    except (DataError, UsageError) as error:
        return str(error) if "\n" not in str(error) and len(str(error)) < 400 else f"BAD sentence {error}"
    except Exception as error:
        return f"BAD {type(error).__name__}: {error}"


def read_all(paths: list[Path], options: dict[str, object], diary: Path) -> None:
    faulthandler.enable(sys.stderr)
    with open(diary, "w", buffering=1, encoding="utf-8") as lines:
        for path in paths:
            lines.write(f"{path.name}\tstarted\n")
            lines.write(f"{path.name}\t{outcome(path, options)!r}\n")


def outcomes(paths: list[Path], options: dict[str, object], diary: Path) -> dict[str, str]:
    """What became of each file, read in one process apart."""
    child = multiprocessing.get_context("spawn").Process(target=read_all, args=(paths, options, diary))
    child.start()
    child.join(LONGEST_S + len(paths))
    if child.is_alive():
        child.kill()
        child.join()
    return dict(line.split("\t", 1) for line in diary.read_text(encoding="utf-8").splitlines())


Make = Callable[..., Path]


def make_film(name: str, codec: str, **rest: object) -> Make:
    def make(folder: Path, encode: Callable[..., Path]) -> Path:
        pictures = noise(10)
        if codec not in ("ffv1", "libx264"):
            import av

            form = "yuvj420p" if codec == "mjpeg" else "yuv422p10le" if codec == "prores_ks" else "yuv420p"
            pictures = [av.VideoFrame.from_ndarray(p, format="gray").reformat(format=form) for p in pictures]
        return encode(name, pictures, codec=codec, time_base=Fraction(1, 25), **rest)

    return make


def make_picture(suffix: str) -> Make:
    def make(folder: Path, encode: Callable[..., Path]) -> Path:
        dtype = np.float32 if suffix in ("hdr", "exr", "pfm") else np.uint8
        light = np.random.default_rng(0).uniform(0, 200, (40, 60, 3)).astype(dtype)
        path = folder / f"a.{suffix}"
        if suffix == "exr":
            OpenEXR.File({}, {c: light[..., k].copy() for k, c in enumerate("RGB")}).write(str(path))
        else:
            cv2.imwrite(str(path), light)
        return path

    return make


def make_npy(folder: Path, encode: Callable[..., Path]) -> Path:
    np.save(folder / "a.npy", np.random.default_rng(0).uniform(size=(5, 9, 8)).astype(np.float32))
    return folder / "a.npy"


def make_npz(folder: Path, encode: Callable[..., Path]) -> Path:
    np.savez_compressed(folder / "a.npz", frames=np.random.default_rng(0).uniform(size=(5, 9, 8)), t_us=np.arange(5))
    return folder / "a.npz"


def make_pages(folder: Path, encode: Callable[..., Path]) -> Path:
    tifffile.imwrite(folder / "a.tif", np.stack(noise(6)), photometric="minisblack", compression="zlib")
    return folder / "a.tif"


MAKERS: dict[str, Make] = {
    "h264-mp4": make_film("a.mp4", "libx264"),
    "h264-fragments": make_film("a.mp4", "libx264", container_options={"movflags": "frag_keyframe+empty_moov"}),
    "h264-ts": make_film("a.ts", "libx264"),
    "h264-raw": make_film("a.h264", "libx264"),
    "ffv1-mkv": make_film("a.mkv", "ffv1"),
    "ffv1-avi": make_film("a.avi", "ffv1"),
    "vp9-webm": make_film("a.webm", "libvpx-vp9", options={"cpu-used": "8"}),
    "mpeg4-avi": make_film("a.avi", "mpeg4"),
    "mpeg2-mpg": make_film("a.mpg", "mpeg2video"),
    "mjpeg-mov": make_film("a.mov", "mjpeg"),
    "prores-mov": make_film("a.mov", "prores_ks"),
    "av1-mp4": make_film("a.mp4", "libsvtav1", options={"preset": "12", "svtav1-params": "lp=1"}),
    "y4m": make_film("a.y4m", "rawvideo"),
    "npy": make_npy,
    "npz": make_npz,
    "pages": make_pages,
} | {suffix: make_picture(suffix) for suffix in ("png", "jpg", "tif", "webp", "bmp", "ppm", "pfm", "hdr", "exr", "jp2")}
PICTURES = ("png", "jpg", "tif", "webp", "bmp", "ppm", "pfm", "hdr", "exr", "jp2")


def fuzz(kind: str, folder: Path, encode: Callable[..., Path], count: int, seed: int) -> None:
    made = MAKERS[kind](folder, encode)
    data, rng = made.read_bytes(), np.random.default_rng(seed)
    paths = []
    for k in range(count):
        place = folder / f"{k}"
        place.mkdir()
        path = place / made.name
        path.write_bytes(damaged(data, rng))
        paths.append(place if kind in PICTURES else path)
    options: dict[str, object] = {"fps": 25} if kind in (*PICTURES, "npy", "pages") else {}
    made.unlink()
    if kind not in PICTURES:
        paths = [path.rename(path.parent.with_suffix(path.suffix)) for path in paths]
    found = outcomes(paths, options, folder / "diary")
    missing = [path.name for path in paths if found.get(path.name, "started") == "started"]
    assert not missing, f"ended the process or never ended: {missing[0]}"
    assert not [said for said in found.values() if "BAD" in said]
    assert len(set(found.values())) > 1 or count < 5, "every accident had the same end: the test tests nothing"


QUICK = ("h264-mp4", "ffv1-mkv", "mpeg4-avi", "npz", "png", "tif", "exr")


@pytest.mark.parametrize("kind", QUICK)
def test_some_accidents(kind: str, tmp_path: Path, encode: Callable[..., Path]) -> None:
    fuzz(kind, tmp_path, encode, 12, 0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAKERS)
def test_many_accidents(kind: str, tmp_path: Path, encode: Callable[..., Path]) -> None:
    fuzz(kind, tmp_path, encode, 300, 1)
