"""All that reads files, each with small valid ones of its kind."""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from hostile import event_seeds, saved

LIGHT = np.linspace(0.05, 1, 12 * 8, dtype=np.float32).reshape(8, 12)
RIG = """
[source]
fov_deg = 60
[[camera]]
name = "left"
kind = "dvs"
translation_mm = [15, 0, 0]
sensor = "davis346"
set = { threshold_on = 0.2 }
[[camera]]
name = "aps"
kind = "cis"
size = [64, 48]
focal_px = [50, 50]
rotation_deg = [0, 1, 0]
clock_offset_us = 12
"""
OBJ = """mtllib a.mtl
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
vt 0 1
vn 0 0 1
usemtl m
f 1/1/1 2/2/1 3/3/1
f 1/1 3/3 4/2
f 2 3 4
"""
MTL = "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd a.png\n"


@dataclass(frozen=True)
class Reader:
    """What reads a kind of files.

    seeds   makes valid ones in a folder: those that are changed
    read    reads a changed one to its end; ends, or raises Vid2evError
    """

    seeds: Callable[[Path], list[Path]]
    read: Callable[[Path], object]


def _events(name: str) -> Reader:
    def read(path: Path) -> None:
        from vid2ev.errors import Vid2evError
        from vid2ev.formats import describe_events, format_named, survey

        kind = format_named(name)
        assert kind.open
        try:
            file = kind.open(path)
            for events in file.events():
                assert len(events) == len(events.x) == len(events.y) == len(events.p) > 0
                assert (events.t.dtype, events.x.dtype, events.y.dtype, events.p.dtype) == ("i8", "u2", "u2", "u1")
                assert events.p.max() <= 1
            for picture in file.frames() if file.has_frames else ():
                assert picture.pixels.dtype == np.uint8
            file.describe()
            if thoroughly(path):
                survey(file)
        except Vid2evError as error:
            check(error)
            if not thoroughly(path):
                raise
        if thoroughly(path):
            describe_events(path)

    return Reader(lambda folder: event_seeds.seeds(name, folder), read)


def check(error: Exception) -> None:
    """What people are told is one sentence that is not too long to be read."""
    said = str(error)
    assert "\n" not in said and 10 < len(said) < 1200, f"no sentence: {said[:2000]!r}"


def thoroughly(path: Path) -> bool:
    """Whether all that reads this content is to read it, rather than what reads first: of one content in four."""
    return zlib.crc32(path.read_bytes()) % 4 == 0


def _texts(**texts: str) -> Callable[[Path], list[Path]]:
    """Files of these contents: `a_b` is called a.b."""

    def seeds(folder: Path) -> list[Path]:
        paths = [folder / name.replace("_", ".") for name in texts]
        for path, text in zip(paths, texts.values(), strict=True):
            path.write_text(text)
        return paths

    return seeds


def _calibrations(folder: Path) -> list[Path]:
    from vid2ev.rig.calibration import FORMATS, write_calibration
    from vid2ev.rig.camera import Camera, Rig

    lens = {
        "size": (64, 48),
        "focal_px": (50.0, 51.0),
        "distortion_model": "radtan",
        "distortion": (0.1, -0.05, 0.001, 0.002),
    }
    left = Camera(name="left", kind="dvs", **lens)  # type: ignore[arg-type]
    right = Camera(name="right", kind="dvs", translation_mm=(30, 1, 0), **lens)  # type: ignore[arg-type]
    paths = []
    for name in FORMATS:
        path = folder / f"{name}.{'json' if name == 'dv' else 'yaml'}"
        write_calibration(path, Rig(cameras=(left, right)), name)
        paths.append(path)
    return paths


def _read_calibration(path: Path) -> None:
    from vid2ev.rig.calibration import read_calibration

    rig = read_calibration(path).rig
    rig.resolved((64, 48))


def _read_rig(path: Path) -> None:
    from vid2ev.rig.rig_file import read_rig, rig_text

    rig = read_rig(path)
    rig_text(rig)
    rig.resolved((64, 48))


def _sensors(folder: Path) -> list[Path]:
    from vid2ev.sensors.presets import KINDS

    paths = []
    for kind in KINDS:
        for name in kind.names()[:2]:
            paths.append(folder / f"{name}.toml")
            paths[-1].write_bytes((kind.presets / f"{name}.toml").read_bytes())
    return paths


def _read_sensor(path: Path) -> None:
    from vid2ev.sensors.presets import kinds_of, load

    load(kinds_of(path)[0], path)


def _scenes(folder: Path) -> list[Path]:
    from vid2ev.scenes.scene_file import PREDEFINED

    shutil.copytree(PREDEFINED, folder / "scenes")
    return sorted((folder / "scenes").glob("*.toml"))


def _read_scene(path: Path) -> None:
    from vid2ev.scenes.scene_file import read_scene

    scene = read_scene(path)
    if thoroughly(path):
        scene.resolved(0)


def _pictures(folder: Path) -> list[Path]:
    import cv2
    import OpenEXR

    codes = np.rint(255 * LIGHT).astype(np.uint8)
    colours = np.dstack([LIGHT, LIGHT[::-1], LIGHT])
    pictures = {"a.png": codes, "b.png": codes.astype(np.uint16) * 257, "a.tif": codes, "b.tif": LIGHT, "a.pfm": LIGHT}
    pictures |= {"a.hdr": colours, "a.jpg": codes, "a.ppm": np.rint(255 * colours).astype(np.uint8), "a.bmp": codes}
    pictures |= {"a.webp": np.rint(255 * colours).astype(np.uint8), "a.jp2": np.tile(codes, (8, 8))}
    for name, pixels in pictures.items():
        cv2.imwrite(str(folder / name), pixels)
    OpenEXR.File({}, {name: LIGHT for name in "RGB"}).write(str(folder / "a.exr"))
    return [*(folder / name for name in pictures), folder / "a.exr"]


def _read_picture(path: Path) -> None:
    from vid2ev.light.picture_files import pages_of, read_picture
    from vid2ev.light.pictures import PictureReader

    picture = read_picture(path, max(pages_of(path), 1) - 1)
    curve = "linear" if picture.pixels.dtype.kind == "f" else "srgb"
    PictureReader(curve).light(picture.pixels, picture.primaries)


def _arrays(folder: Path) -> list[Path]:
    frames = np.stack([LIGHT, LIGHT[::-1], LIGHT])
    np.save(folder / "a.npy", frames)
    np.savez(folder / "a.npz", frames=frames, t_us=np.arange(3) * 10_000)
    np.savez_compressed(folder / "b.npz", video=(255 * frames).astype(np.uint8), fps=25)
    return [folder / "a.npy", folder / "a.npz", folder / "b.npz"]


def _read_arrays(path: Path) -> None:
    from vid2ev.sources import open_source

    options: dict[str, Any] = {"fps": 25} if path.suffix == ".npy" else {}
    source = open_source(path, transfer="srgb" if path.stem == "b" else "linear", **options)
    for number, _ in enumerate(source.frames()):
        assert number < 5000, "frames without end"


def _times(folder: Path) -> list[Path]:
    np.save(folder / "a_timestamps.npy", np.arange(5) * 33_333)
    np.save(folder / "b_timestamps.npy", np.arange(5) / 30)
    (folder / "timestamps.txt").write_text("".join(f"{k / 30:.6f}\n" for k in range(5)))
    spans = "".join(f"{33_333 * k} {33_333 * k + 500}\n" for k in range(5))
    (folder / "spans.txt").write_text(f"# start_us end_us\n{spans}")
    (folder / "motion.csv").write_text("t,x,y,angle,zoom\n0,0,0,0,1\n1,5,2,3,1.1\n2,9,3,3,1\n")
    poses = "".join(f"{k / 30:.9f} 0.1 0.0 {k / 10} 0.0 0.0 0.0 1.0\n" for k in range(3))
    (folder / "poses.txt").write_text(f"# timestamp tx ty tz qx qy qz qw\n{poses}")
    return sorted(folder.iterdir())


def _read_times(path: Path) -> None:
    from vid2ev.recording.pose_text import read_poses
    from vid2ev.sources.motion import parse_motion
    from vid2ev.sources.times import read_timestamp_array, read_timestamps

    def read_motion(path: Path) -> object:
        return parse_motion(str(path))

    readers: dict[str, Callable[[Path], object]] = {".npy": read_timestamp_array, ".csv": read_motion}
    (read_poses if path.name == "poses.txt" else readers.get(path.suffix, read_timestamps))(path)


def _depths(folder: Path) -> list[Path]:
    import cv2
    import OpenEXR

    from vid2ev.recording.truth_files import write_depth, write_flow, write_mask, write_pixel_map

    np.save(folder / "a.npy", LIGHT)
    np.savez_compressed(folder / "a.npz", depth=LIGHT, other=LIGHT[0])
    cv2.imwrite(str(folder / "a.png"), (1000 * LIGHT).astype(np.uint16))
    cv2.imwrite(str(folder / "a.pfm"), LIGHT)
    cv2.imwrite(str(folder / "a.tif"), LIGHT)
    OpenEXR.File({}, {"Z": LIGHT}).write(str(folder / "a.exr"))
    made = folder / "truth"
    made.mkdir()
    for name in ("depth.npy", "depth.exr", "depth.png"):
        write_depth(made / name, LIGHT)
    for name in ("flow.npz", "flow.flo", "flow.png"):
        write_flow(made / name, np.dstack([LIGHT, -LIGHT]))
    write_mask(made / "mask.png", LIGHT > 0.5)
    write_pixel_map(made / "pixels.npz", np.dstack([LIGHT, LIGHT]))
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _read_depth(path: Path) -> None:
    from vid2ev.recording import truth_files
    from vid2ev.rig.depth import DepthScale
    from vid2ev.rig.depth_files import DepthFiles

    if path.parent.name != "truth":
        DepthFiles(path, (12, 8), DepthScale(scale=0.001)).at(0)
    elif path.suffix == ".txt":
        {"depth": truth_files.read_depth, "flow": truth_files.read_flow}[path.stem](path.with_suffix(".png"))
    else:
        readers = {"mask": truth_files.read_mask, "pixels": truth_files.read_pixel_map, "flow": truth_files.read_flow}
        readers.get(path.stem, truth_files.read_depth)(path)


def _meshes(folder: Path) -> list[Path]:
    import cv2
    import trimesh

    (folder / "a.obj").write_text(OBJ)
    (folder / "a.mtl").write_text(MTL)
    cv2.imwrite(str(folder / "a.png"), (255 * LIGHT).astype(np.uint8))
    box = trimesh.creation.box()
    for name in ("b.ply", "b.stl", "b.glb", "b.obj"):
        box.export(folder / name)
    (folder / "c.ply").write_bytes(box.export(file_type="ply", encoding="ascii"))
    (folder / "c.stl").write_text(box.export(file_type="stl_ascii"))
    for name, content in trimesh.Scene(box).export(file_type="gltf").items():
        (folder / name.replace("model", "d")).write_bytes(content)
    return sorted(folder.iterdir())


def _read_mesh(path: Path) -> None:
    from vid2ev.scenes.mesh_files import SUFFIXES, load_mesh

    load_mesh(path if path.suffix in SUFFIXES else path.parent / ("d.gltf" if path.suffix == ".bin" else "a.obj"))


def _weights(folder: Path) -> list[Path]:
    from interp import weights
    from interp.networks import make

    for name, options in (("firenet", {}), ("rrin_events_light", {"depths": (2, 2, 2, 2)})):
        weights.save(folder / f"{name}.safetensors", name, make(name, "tiny", **options))
    return sorted(folder.iterdir())


def _read_weights(path: Path) -> None:
    from interp import weights

    weights.load(path)


def _manifests(folder: Path) -> list[Path]:
    from vid2ev import convert

    convert("synthetic:moving-edge,size=16x12,fps=100,duration_s=0.05", folder / "made", preview=False, threads=1)
    return [folder / "made" / "manifest.json"]


def _read_manifest(path: Path) -> None:
    from click.testing import CliRunner

    from vid2ev.commands.info import info
    from vid2ev.errors import Vid2evError
    from vid2ev.recording.manifest import is_of_job, read_manifest

    done = CliRunner().invoke(info, [str(path.parent)])
    if done.exception and not isinstance(done.exception, SystemExit | Vid2evError):
        raise done.exception
    is_of_job(path, {"source": {"kind": "x"}}, path.parent, overwrite=True)
    read_manifest(path)


READERS: dict[str, Reader] = {f"events-{name}": _events(name) for name in event_seeds.READABLE}
READERS |= {
    "calibration": Reader(_calibrations, _read_calibration),
    "rig": Reader(_texts(rig_toml=RIG), _read_rig),
    "sensor": Reader(_sensors, _read_sensor),
    "scene": Reader(_scenes, _read_scene),
    "pictures": Reader(_pictures, _read_picture),
    "arrays": Reader(_arrays, _read_arrays),
    "times": Reader(_times, _read_times),
    "depth": Reader(_depths, _read_depth),
    "meshes": Reader(_meshes, _read_mesh),
    "weights": Reader(_weights, _read_weights),
    "manifests": Reader(_manifests, _read_manifest),
}
READERS |= {name: Reader(*pair) for name, pair in saved.READERS.items()}
