"""Files that nobody vouches for: bombs are refused before they go off, names stay in their folder, nothing is run."""

from __future__ import annotations

import io
import json
import os
import pickle
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch

from interp import weights
from interp.networks import make
from interp.train.checkpoints import read_checkpoint
from vid2ev.compare.recordings import compare_recordings
from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.formats import format_named, open_events, recognise
from vid2ev.formats.event_file import Picture, Recording
from vid2ev.formats.ros1 import write_events as write_bag
from vid2ev.light.picture_files import read_picture
from vid2ev.light.recognise import head_of
from vid2ev.recording.exposures import read_codes, read_spans
from vid2ev.recording.manifest import as_stated, read_manifest
from vid2ev.recording.pose_text import read_poses
from vid2ev.recording.truth_files import read_depth, read_flow, read_mask, write_flow
from vid2ev.reformat import reformat
from vid2ev.rig.calibration import read_calibration
from vid2ev.rig.depth import DepthScale
from vid2ev.rig.depth_files import DepthFiles
from vid2ev.rig.rig_file import read_rig
from vid2ev.scenes.mesh_files import load_mesh
from vid2ev.scenes.scene_file import read_scene
from vid2ev.sensors.presets import load_sensor
from vid2ev.sources import open_source
from vid2ev.sources.many import _listed, sources_in
from vid2ev.sources.motion import parse_motion
from vid2ev.sources.times import read_timestamp_array, read_timestamps
from vid2ev.toml_text import parsed_toml
from vid2ev.untrusted import LARGEST, PATHS, beside, json_of, most_bytes, read_arrays, read_text
from vid2ev.views.render import render

MEGABYTE = 1 << 20


def npy_head(shape: tuple[int, ...], dtype: str = "<f4") -> bytes:
    """The beginning of a .npy file: all that a bomb needs."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": dtype, "fortran_order": False, "shape": shape})
    return head.getvalue()


def npz(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return path


def events_in(path: Path) -> list[Any]:
    """All that an event file says."""
    file = open_events(path)
    return [file.size, *(getattr(part, name).tolist() for part in file.events() for name in "txyp")]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight megabytes may be taken."""
    monkeypatch.setenv(LARGEST, "8")


def bomb_of_zeros(side: int) -> bytes:
    return npy_head((side, side)) + bytes(4 * side * side)


@pytest.mark.usefixtures("small")
def test_arrays_that_claim_too_much_are_refused_and_the_limit_can_be_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    claims = npy_head((1 << 20, 1 << 20))
    (tmp_path / "a.npy").write_bytes(claims)
    packed = npz(tmp_path / "a.npz", flow=npy_head((2000, 2000, 2)) + bytes(32_000_000))
    assert packed.stat().st_size < MEGABYTE
    for read in (
        lambda: read_depth(tmp_path / "a.npy"),
        lambda: read_timestamp_array(tmp_path / "a.npy"),
        lambda: read_flow(packed),
        lambda: DepthFiles(npz(tmp_path / "d.npz", depth=bomb_of_zeros(2000)), (2000, 2000), DepthScale()),
    ):
        with pytest.raises(DataError, match=f"are allowed; if that is meant, set {LARGEST}="):
            read()
    monkeypatch.setenv(LARGEST, "100")
    assert read_flow(packed).shape == (2000, 2000, 2)


def test_a_limit_that_is_no_number_is_a_mistake_of_who_set_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LARGEST, "much")
    with pytest.raises(UsageError, match="whole number of megabytes"):
        most_bytes()


@pytest.mark.parametrize("limit", ["much", "9" * 9, "9" * 10, "9" * 40, "9" * 5000])
def test_no_limit_ends_the_program_without_a_sentence(tmp_path: Path, limit: str) -> None:
    np.save(tmp_path / "a.npy", np.zeros((2, 8, 8), np.float32))
    command = [sys.executable, "-m", "vid2ev", "convert", str(tmp_path / "a.npy"), "--fps", "9", "--dry-run"]
    limited = {name: value for name, value in os.environ.items() if not name.startswith("OPENCV")} | {LARGEST: limit}
    assert subprocess.run([sys.executable, "-c", "import vid2ev, cv2"], env=limited, timeout=100).returncode == 0
    done = subprocess.run(command, env=limited, capture_output=True, text=True, timeout=100)
    if limit == "9" * 9:
        assert done.returncode == 0
    else:
        assert done.returncode == 2 and done.stderr.startswith(f"error: {LARGEST}=") and done.stderr.count("\n") == 1


def test_pictures_that_claim_too_much_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head = struct.pack(">IIBBBBB", 1 << 19, 1 << 19, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(bytes(100_000))), (b"IEND", b"")]
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    (tmp_path / "a.png").write_bytes(png)
    with pytest.raises(DataError, match=f"more pixels than are allowed; .*{LARGEST}"):
        read_picture(tmp_path / "a.png")
    OpenEXR = pytest.importorskip("OpenEXR")
    OpenEXR.File({}, {"Y": np.ones((600, 600), np.float32)}).write(str(tmp_path / "a.exr"))
    read_picture(tmp_path / "a.exr")
    monkeypatch.setenv(LARGEST, "1")
    with pytest.raises(DataError, match="its pixels would take 3 MB"):
        read_picture(tmp_path / "a.exr")


def hdf5(path: Path, **datasets: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name in "txyp":
            file[f"events/{name}"] = np.zeros(4, np.uint16)
        for name, options in datasets.items():
            file.create_dataset(name.replace("__", "/"), **options)
    return path


@pytest.mark.usefixtures("small")
def test_hdf5_cannot_fill_the_memory_or_reach_into_other_files(tmp_path: Path) -> None:
    zeros = {"shape": (1 << 22,), "dtype": "i8", "chunks": (1 << 16,), "compression": "gzip", "data": np.zeros(1 << 22)}
    with pytest.raises(DataError, match="frames/t would take 32 MB"):
        open_events(hdf5(tmp_path / "a.h5", frames__t=zeros))
    path = hdf5(tmp_path / "b.h5")
    with h5py.File(path, "r+") as file:
        del file["events/t"]
        file.create_dataset("events/t", (4,), "u2", chunks=(1 << 23,), maxshape=(None,))
    with pytest.raises(DataError, match="a chunk of /events/t would take 16 MB"):
        open_events(path)
    other = hdf5(tmp_path / "secret.h5")
    for link in ("external", "virtual"):
        path = hdf5(tmp_path / f"{link}.h5")
        with h5py.File(path, "r+") as file:
            del file["events/t"]
            if link == "external":
                file["events/t"] = h5py.ExternalLink(str(other), "events/t")
            else:
                layout = h5py.VirtualLayout((4,), "u2")
                layout[:] = h5py.VirtualSource(str(other), "events/t", (4,))
                file.create_virtual_dataset("events/t", layout)
        with pytest.raises(DataError, match="is in another file"):
            open_events(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
@pytest.mark.parametrize("name", ["events", "events/t", "events/label", "frames/t", "t_offset"])
@pytest.mark.parametrize("within", [0, 1, 3])
def test_hdf5_does_not_wait_for_a_pipe_that_it_names(tmp_path: Path, name: str, within: int) -> None:
    """Nor for the terminal, by whatever links within the file it leads there."""
    os.mkfifo(tmp_path / "pipe")
    path = hdf5(tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        if name in file:
            del file[name]
        names = [name, *(f"other{k}/t" for k in range(within))]
        for here, there in pairwise(names):
            file[here] = h5py.SoftLink(f"/{there}")
        file[names[-1]] = h5py.ExternalLink("pipe", "t")
    with pytest.raises(DataError, match=rf"{name}(/t)? is in another file"):
        open_events(path)


def test_hdf5_may_have_links_within(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5")
    expected = events_in(path)
    with h5py.File(path, "r+") as file:
        file.move("events", "prophesee/left")
        file["left"] = h5py.SoftLink("prophesee/left")
        file["events"] = h5py.SoftLink("./left")
    assert events_in(path) == expected


def event_stream(path: Path, size: tuple[int, int]) -> Path:
    path.write_bytes(b"Event Stream" + bytes([2, 0, 0, 1]) + struct.pack("<HH", *size) + bytes(5))
    return path


def hdf5_of(path: Path, size: tuple[int, int]) -> Path:
    with h5py.File(hdf5(path), "r+") as file:
        file.attrs.update(width=size[0], height=size[1])
    return path


def bag_of(path: Path, size: tuple[int, int]) -> Path:
    write_bag(path, Recording(size, 0, 0, 0, lambda: iter(())))
    return path


@pytest.mark.parametrize(
    ("make", "size"),
    [
        *((event_stream, size) for size in ((0, 0), (0, 3), (3, 0))),
        *((hdf5_of, size) for size in ((0, 8), (8, -1), (1 << 40, 8), (8, (1 << 16) + 1))),
        *((bag_of, size) for size in ((1 << 31, 1 << 31), (8, (1 << 16) + 1))),
    ],
)
def test_sizes_that_no_sensor_has_are_refused(
    make: Callable[[Path, tuple[int, int]], Path], size: tuple[int, int], tmp_path: Path
) -> None:
    path = make(tmp_path / "events", size)
    with pytest.raises(DataError, match=rf"says {size[0]}x{size[1]} pixels, expected 1 to 65536"):
        open_events(path)
    assert open_events(make(tmp_path / "events", (1 << 10, 1))).size == (1 << 10, 1)


@pytest.mark.usefixtures("small")
def test_sensors_take_no_more_memory_than_a_file_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of 21 bytes may say that it is of 65535x65535 pixels."""
    path = event_stream(tmp_path / "large.es", (1000, 1000))
    with pytest.raises(DataError, match=r"a comparison of 1000x1000 pixels would take 48 MB"):
        compare_recordings(path, path)
    with pytest.raises(DataError, match=r"a picture of 1000x1000 pixels would take 16 MB"):
        render(path, tmp_path / "a.png")
    assert reformat(path, tmp_path / "large.npz")["size"] == [1000, 1000]  # (which has nothing of each pixel)
    monkeypatch.setenv(LARGEST, "48")
    assert compare_recordings(path, path).comparison.events == 1
    assert render(path, tmp_path / "a.png")["events"] == 1


def pictures_of(name: str, path: Path, shape: tuple[int, int]) -> Path:
    """A file of events with a frame."""
    picture = Picture(5, np.zeros(shape, np.uint8))
    write = format_named(name).write
    assert write
    write(path, Recording((8, 8), 0, 10, 0, lambda: iter(()), frames=lambda: iter([picture])))
    return path


@pytest.mark.parametrize("name", ["aedat4", "ros1", "ros2"])
@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0)])
def test_frames_of_no_pixels_are_refused(name: str, shape: tuple[int, int], tmp_path: Path) -> None:
    assert [frame.pixels.shape for frame in open_events(pictures_of(name, tmp_path / "one", (1, 1))).frames()] == [
        (1, 1)
    ]
    with pytest.raises(DataError, match="damaged"):
        list(open_events(pictures_of(name, tmp_path / "none", shape)).frames())


def test_texts_that_are_nested_too_deeply_are_no_texts(tmp_path: Path) -> None:
    deep = "[" * 100_000
    (tmp_path / "a.toml").write_text(f"[dvs]\nthreshold_on = {deep}")
    (tmp_path / "a.json").write_text(deep)
    for read in (load_sensor, read_scene, read_rig):
        with pytest.raises(DataError, match="nested too deeply"):
            read(tmp_path / "a.toml")
    with pytest.raises(DataError, match="nested too deeply"):
        read_manifest(tmp_path / "a.json")
    for text in (f"cam0: {deep}", f"cam0:\n  T_cam_imu: {'{a: ' * 200}", f"%YAML:1.0\ncam0: {deep}"):
        (tmp_path / "a.yaml").write_text(text)
        with pytest.raises(DataError, match="nested too deeply"):
            read_calibration(tmp_path / "a.yaml")


def test_a_png_takes_no_room_for_what_it_has_not(tmp_path: Path) -> None:
    """OpenCV takes 4 GB for this one, whose second part says that it is 2.3 GB long."""
    import cv2

    place = tmp_path / "a.png"
    cv2.imwrite(str(place), np.arange(96, dtype=np.uint8).reshape(8, 12))
    whole = place.read_bytes()
    place.write_bytes(whole + b"more")
    assert np.array_equal(read_picture(place).pixels.ravel(), np.arange(96))
    for damaged in (whole[:33] + b"\x8c" + whole[34:], whole[:-20], whole[:40]):
        place.write_bytes(damaged)
        for reads in (read_picture, read_codes, read_mask):
            with pytest.raises(DataError, match="cut short"):
                reads(place)


READERS: dict[str, Callable[[Path], object]] = {
    "pipe": head_of,
    "pipe.npz": read_arrays,
    "events": recognise,
    "text": read_text,
    "rig.toml": read_rig,
    "poses.txt": read_poses,
    "timestamps.txt": read_timestamps,
    "timestamps.npy": read_timestamp_array,
    "list.txt": _listed,
    "path.csv": lambda path: parse_motion(str(path)),
    "depth.npy": read_depth,
    "depth.exr": read_depth,
    "flow.flo": read_flow,
    "flow.npz": read_flow,
    "mask.png": read_mask,
    "bag.db3": lambda path: open_events(bag_of(path)),
    "bag.db3.zstd": lambda path: open_events(bag_of(path)),
}


def bag_of(part: Path) -> Path:
    """A folder that says that it is a bag of ROS 2, and has this part."""
    (part.parent / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths: [{part.name}]\n")
    return part.parent


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_is_said_to_be_one_and_not_waited_for(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / name)
    pipe = os.open(tmp_path / name, os.O_RDWR)
    os.write(pipe, bytes(1 << 15))  # (so that whoever reads it all the same does not wait either)
    with pytest.raises(DataError, match=f"{name}: a pipe, expected a file"):
        READERS[name](tmp_path / name)
    os.close(pipe)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere this device is none, or has another name")
@pytest.mark.parametrize("name", READERS)
def test_a_device_is_said_to_be_one_and_not_read_for_ever(name: str, tmp_path: Path) -> None:
    """Nobody comes to the end of this one, whose size is 0."""
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(DataError, match=f"{name}: a device, expected a file"):
        READERS[name](tmp_path / name)


OSERROR = ("pipe", "pipe.npz", "text", "rig.toml", "bag.db3", "bag.db3.zstd")  # (which others make a sentence of)


@pytest.mark.parametrize("name", [name for name in READERS if name not in OSERROR])
def test_a_name_that_no_file_can_have_is_a_sentence(name: str, tmp_path: Path) -> None:
    with pytest.raises((DataError, UsageError), match=name[-4:]):
        READERS[name](tmp_path / f"{300 * 'x'}{name}")


def test_flow_takes_no_more_memory_than_a_file_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_flow(tmp_path / "a.flo", np.zeros((300, 500, 2), np.float32))
    assert read_flow(tmp_path / "a.flo").shape == (300, 500, 2)
    monkeypatch.setenv(LARGEST, "1")
    with pytest.raises(DataError, match="would take 2 MB of memory, and 1 are allowed"):
        read_flow(tmp_path / "a.flo")


def test_yaml_that_says_a_list_a_thousand_times_is_no_calibration(tmp_path: Path) -> None:
    once = f"&a [{', '.join(['1'] * 2000)}]"
    text = f"cam0:\n  camera_model: pinhole\n  distortion_model: none\n  intrinsics: [{once}{', *a' * 2000}]\n"
    (tmp_path / "a.yaml").write_text(f"{text}  distortion_coeffs: []\n  resolution: [2, 2]\n")
    with pytest.raises(DataError, match="at most 1000 numbers"):
        read_calibration(tmp_path / "a.yaml")


def test_scenes_have_so_many_things_and_no_more(tmp_path: Path) -> None:
    things = "".join(f'[[objects]]\nname = "o{k}"\ncount = 1000\nshape = "sphere"\n' for k in range(9))
    (tmp_path / "a.toml").write_text(f"[scene]\nduration_s = 1\n{things}")
    with pytest.raises(UsageError, match="expected at most 5,000 in all"):
        read_scene(tmp_path / "a.toml")


RIG = '[[camera]]\nname = "a"\nkind = "dvs"\nsize = [8, 8]\n'
SENSOR = "[dvs]\nthreshold_on = 0.3\n"


@pytest.mark.parametrize(
    ("name", "text", "read"),
    [
        ("timestamps.txt", "0.0\n0.5\n1.0\n", read_timestamps),
        ("timestamps.txt", "# unit: ms\n0\n40\n", read_timestamps),
        ("list.txt", "a.mp4\nb.mp4\n", lambda path: sources_in(str(path))),
        ("poses.txt", "0.5 1 2 3 0 0 0 1\n", lambda path: [array.tolist() for array in read_poses(path)]),
        ("spans.txt", "0 100\n", lambda path: read_spans(path).tolist()),
        ("path.csv", "t,x,y\n0,0,0\n1,2,3\n", lambda path: vars(parse_motion(str(path)))),
        ("sensor.toml", SENSOR, lambda path: load_sensor(path)),
        ("rig.toml", RIG, read_rig),
        ("events.csv", "t,x,y,p\n81,4,17,1\n", events_in),
        ("events.csv", "%geometry:32,32\n4,17,1,81\n", events_in),
        ("events.txt", "0.081000 4 17 1\n", events_in),
        ("events.txt", "# t x y p\n32 32\n0.081000 4 17 1\n", events_in),
    ],
)
def test_the_mark_that_windows_puts_before_a_text_is_no_part_of_it(
    name: str, text: str, read: Callable[[Path], Any], tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    plain = str(read(tmp_path / name))
    (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert str(read(tmp_path / name)) == plain


def test_names_in_files_stay_in_their_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "mine.toml").write_text("[dvs]\n")
    rig, scene = tmp_path / "in" / "rig.toml", tmp_path / "in" / "scene.toml"
    assert beside(rig, "sub/mine.toml") == tmp_path / "in" / "sub" / "mine.toml"
    for name in ("../mine.toml", str(tmp_path / "mine.toml"), "sub/../../mine.toml"):
        rig.write_text(f'[[camera]]\nname = "a"\nkind = "dvs"\nsensor = "{name}"\n')
        scene.write_text(f'[scene]\nduration_s = 1\n[[objects]]\nname = "a"\nshape = "mesh"\nfile = "{name}"\n')
        for read, path in ((read_rig, rig), (read_scene, scene)):
            with pytest.raises(UsageError, match=f"not in its folder or below; .* {PATHS}=anywhere"):
                read(path)
    assert read_rig(rig, to_use=False).cameras[0].sensor == str(tmp_path / "mine.toml")
    monkeypatch.setenv(PATHS, "anywhere")
    assert read_rig(rig).cameras[0].sensor == str(tmp_path / "mine.toml")


@pytest.mark.parametrize("name", ["a" * 256, "a/" * 2100, "ä" * 200])
def test_names_that_no_file_can_have_are_one_sentence(name: str, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(f'[[objects]]\nkind = "plane"\nsize_m = [1, 1, 0]\ntexture = "{name}"\n', encoding="utf-8")
    with pytest.raises(UsageError, match="expected the name of a file"):
        read_scene(scene)


def test_whole_numbers_of_toml_have_64_bits(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    for number in ("9" * 400, str(2**63), f"[[{-(2**63) - 1}]]", f"{{ uniform = [0, {'9' * 5000}] }}"):
        scene.write_text(f"[scene]\nduration_s = {number}\n")
        with pytest.raises(DataError, match=r"64 at most|integer string"):
            read_scene(scene)
    assert parsed_toml(f"a = {2**63 - 1}") == {"a": 2**63 - 1}


def test_pictures_that_a_mesh_names_are_beside_it(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    from vid2ev.recording.exposures import write_codes

    (tmp_path / "in").mkdir()
    write_codes(tmp_path / "secret.png", np.full((4, 4, 3), 200, np.uint8))
    (tmp_path / "in" / "a.mtl").write_text("newmtl m\nmap_Kd ../secret.png\n")
    (tmp_path / "in" / "a.obj").write_text(
        "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    texture = load_mesh(tmp_path / "in" / "a.obj").texture
    assert (
        texture is None or not np.allclose(texture.pixels, texture.pixels.max(), atol=0.5) or texture.pixels.max() < 0.5
    )


def test_meshes_that_claim_too_much_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    claims = {"asset": {"version": "2.0"}, "accessors": [{"componentType": 5126, "count": 1 << 40, "type": "VEC3"}]}
    (tmp_path / "a.gltf").write_text(json.dumps(claims))
    with pytest.raises(DataError, match="its arrays would take"):
        load_mesh(tmp_path / "a.gltf")


def test_weights_that_ask_for_a_huge_network_take_no_memory(tmp_path: Path) -> None:
    from safetensors.torch import save_file

    spec = json.dumps({"size": "paper", "bins": 10**6})
    save_file({"a": torch.zeros(1)}, tmp_path / "a.safetensors", {"network": "rrin_events", "spec": spec})
    with pytest.raises(DataError):
        weights.load(tmp_path / "a.safetensors")
    weights.save(tmp_path / "b.safetensors", "firenet", make("firenet"))
    assert weights.load(tmp_path / "b.safetensors")


class Ran:
    """What a pickle would run."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (Path("ran"),)


@pytest.mark.parametrize("packed", ["torch", "plain"])
def test_checkpoints_run_nothing(packed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "checkpoint.ckpt"
    state = {"global_step": 3, "state_dict": {}, "evil": Ran()}
    if packed == "torch":
        torch.save(state, path)
    else:
        path.write_bytes(pickle.dumps(state))
    with pytest.raises(DataError, match="is no whole checkpoint") as refused:
        read_checkpoint(path)
    assert "torch" not in str(refused.value).lower() and "trust" not in str(refused.value)
    assert not (tmp_path / "ran").exists()


def test_arrays_of_objects_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([Ran()], object), allow_pickle=True)
    for read in (read_depth, read_timestamp_array):
        with pytest.raises(DataError):
            read(tmp_path / "a.npy")


def test_times_of_millions_of_digits_are_no_times(tmp_path: Path) -> None:
    for word in ("0.1e40000000", "1e-99999999", "9" * 100_000):
        (tmp_path / "timestamps.txt").write_text(f"{word}\n1\n")
        with pytest.raises(DataError, match="is no time"):
            read_timestamps(tmp_path / "timestamps.txt")


def test_what_errors_quote_of_files_is_short_and_moves_no_cursor() -> None:
    for kind in (DataError, UsageError):
        said = str(kind(f"a.toml: key '\x1b[2J{'9' * 5000}'\nis unknown"))
        assert len(said) < 200 and said.isprintable() and said.startswith("a.toml: key '") and said.endswith("unknown")
    assert str(pickle.loads(pickle.dumps(DataError("as it is")))) == "as it is"


def test_what_a_manifest_lacks_is_one_sentence(tmp_path: Path) -> None:
    said = r"m.json does not say what it should \(KeyError: 'size'\)"
    with pytest.raises(DataError, match=said), as_stated(tmp_path / "m.json"):
        dict[str, int]()["size"]
    with pytest.raises(UsageError), as_stated(tmp_path / "m.json"):
        raise UsageError("as it is")
    assert issubclass(DataError, Vid2evError)


@pytest.mark.parametrize("name", ["clip.npy", "clip.npz"])
def test_an_array_whose_header_has_numbers_for_names_is_one_sentence(name: str, tmp_path: Path) -> None:
    array = tmp_path / "clip.npy"
    np.save(array, np.ones((3, 4, 5), np.float32))
    array.write_bytes(array.read_bytes().replace(b"'descr'", b"1234567"))  # (which numpy cannot put in order)
    if name == "clip.npz":
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.write(array, "frames.npy")
    with pytest.raises(DataError, match=r"clip.*write it with numpy"):
        open_source(tmp_path / name, fps=10)


def test_numbers_too_large_to_be_one_are_none() -> None:
    assert json_of('{"a": 1e300}') == {"a": 1e300}
    with pytest.raises(ValueError, match="1e400 is too large"):
        json_of('{"a": 1e400}')
