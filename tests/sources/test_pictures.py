"""Files of pictures, read as other libraries read them; the content decides, not the name."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import av
import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image, ImageOps

from vid2ev.errors import DataError, UsageError
from vid2ev.light import picture_files
from vid2ev.light.picture_files import read_picture
from vid2ev.light.recognise import recognise
from vid2ev.light.tags import BT709_WEIGHTS
from vid2ev.light.transfer import code_table
from vid2ev.sources import open_source
from vid2ev.untrusted import plain_name


def codes(shape: tuple[int, ...], dtype: type = np.uint8) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype)


# ---------------------------------------------------------------------------------------------------------- upright


def marked(webp: bytes) -> bytes:
    """A WebP, at the end of which is EXIF, with the mark before it that JPEG has, as libvips writes it."""
    before, exif = webp.split(b"EXIF")
    exif = b"Exif\0\0" + exif[4 : 4 + struct.unpack("<I", exif[:4])[0]]
    content = before[8:] + b"EXIF" + struct.pack("<I", len(exif)) + exif + b"\0" * (len(exif) % 2)
    return b"RIFF" + struct.pack("<I", len(content)) + content


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "webp", "marked.webp"])
def test_exif_turns_a_picture_as_viewers_do(tmp_path: Path, orientation: int, suffix: str) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    scene = np.kron(codes((3, 4, 3)), np.ones((8, 8, 1), np.uint8))
    path = tmp_path / f"a.{suffix}"
    options = {"jpg": {"quality": 95}}.get(suffix, {"lossless": True} if "webp" in suffix else {})
    Image.fromarray(scene).save(path, exif=exif, **options)
    if suffix == "marked.webp":
        path.write_bytes(marked(path.read_bytes()))
    with Image.open(path) as shown:
        expected = np.asarray(ImageOps.exif_transpose(shown).convert("RGB"))
    pixels = read_picture(path).pixels
    assert pixels.shape == expected.shape
    np.testing.assert_allclose(pixels.astype(int), expected, atol=2 if suffix == "jpg" else 0)


# ---------------------------------------------------------------------------------------------------------- kinds


def pnm(kind: str, most: int, values: np.ndarray) -> bytes:
    """A PNM or PAM of values [H, W] or [H, W, C] of which `most` is white."""
    if kind == "P7":
        depth = values[0, 0].size
        name = ("GRAYSCALE", "GRAYSCALE_ALPHA", "RGB", "RGB_ALPHA")[depth - 1]
        said = {"WIDTH": values.shape[1], "HEIGHT": values.shape[0], "DEPTH": depth, "MAXVAL": most, "TUPLTYPE": name}
        head = "".join(f"{key} {value}\n" for key, value in said.items())
        return f"P7\n# of a test\n{head}ENDHDR\n".encode() + values.astype(">u2" if most > 255 else "u1").tobytes()
    head = f"{kind}\n# of a test\n{values.shape[1]} {values.shape[0]}\n{most}\n".encode()
    if kind in ("P2", "P3"):
        return head + " ".join(map(str, values.ravel().tolist())).encode() + b"\n"
    return head + values.astype(">u2" if most > 255 else "u1").tobytes()


@pytest.mark.parametrize("most", [1, 15, 100, 127, 255, 256, 300, 511, 1000, 1023, 4095, 65534, 65535])
@pytest.mark.parametrize(("kind", "channels"), [
    ("P2", 1), ("P3", 3), ("P5", 1), ("P6", 3), ("P7", 1), ("P7", 2), ("P7", 3), ("P7", 4),
])  # fmt: skip
def test_white_of_a_pnm_is_what_its_header_says(tmp_path: Path, kind: str, channels: int, most: int) -> None:
    """FFmpeg writes 10 bits into 16, and that 1023 is white; others write what they like."""
    values = np.linspace(0, most, 24 * channels).astype(int).reshape((4, 6, channels))
    for k in range(2):
        (tmp_path / f"{k}.{'ppm' if channels > 2 else 'pgm'}").write_bytes(pnm(kind, most, values))
    values = values[..., :3] if channels > 2 else values[..., 0]
    bits = most.bit_length()
    for transfer in ("linear", f"linear:{bits}bit") if most == 2**bits - 1 else ("linear",):
        source = open_source(tmp_path, fps=1, colour="rgb", transfer=transfer)
        first, _ = source.frames()
        expected = values / most if values.ndim == 3 else np.repeat(values[..., None] / most, 3, axis=2)
        np.testing.assert_allclose(first.light, expected, atol=1e-6)
        assert source.warnings == []


def test_pictures_of_another_white_than_the_first_are_refused(tmp_path: Path) -> None:
    for k, most in enumerate((1000, 1000, 500)):
        (tmp_path / f"{k}.pgm").write_bytes(pnm("P5", most, np.full((4, 6), 400)))
    source = open_source(tmp_path, fps=1, transfer="linear")
    assert (source.describe()["bits"], source.describe()["white"]) == (10, 1000)
    coming = source.frames()
    assert next(coming).light == pytest.approx(0.4) and next(coming).light == pytest.approx(0.4)
    with pytest.raises(DataError, match=r"2\.pgm: white is code 500 by its header, expected 1000 as in the first"):
        next(coming)
    (frame, *_) = open_source(tmp_path, fps=1, transfer="linear:9bit").frames()  # somebody says it of all of them
    assert frame.light == pytest.approx(400 / 511)


@pytest.mark.parametrize("most", [100, 255, 300])
@pytest.mark.parametrize("kind", ["P2", "P5", "P7"])
def test_numbers_of_a_picture_that_is_a_map_are_as_they_stand(tmp_path: Path, kind: str, most: int) -> None:
    values = np.linspace(0, most, 24).astype(int).reshape(4, 6)
    (tmp_path / "depth.pgm").write_bytes(pnm(kind, most, values))
    np.testing.assert_array_equal(read_picture(tmp_path / "depth.pgm").pixels, values)


@pytest.mark.parametrize(
    "content",
    [
        b"P2",
        b"P2 2 2 255 1 2 3",
        b"P3 1 1 300 1 2 x",
        b"P2 2 -2 9 1 2 3 4",
        b"P2 1 1 0 0",
        b"P2 9999999999999999 1 9 7",
        b"P7\nWIDTH 99999999999999999999\nHEIGHT 1\nDEPTH 1\nMAXVAL 9\nENDHDR\n1",
        b"P2 2 1 9 " + b"9" * 9999,
    ],
)
def test_a_damaged_text_is_no_picture(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "0.pgm").write_bytes(content)
    with pytest.raises(DataError, match=r"0\.pgm: not an image that can be read"):
        read_picture(tmp_path / "0.pgm")


@pytest.mark.parametrize("name", ["DEPTH", "MAXVAL", "HEIGHT", "ENDHDR"])
def test_a_damaged_pam_is_no_picture(tmp_path: Path, name: str) -> None:
    content = pnm("P7", 300, np.full((4, 6, 3), 7))
    for damaged in (content.replace(name.encode(), b"X"), content[:-1], content.replace(b"DEPTH 3", b"DEPTH 9" * 99)):
        (tmp_path / "0.ppm").write_bytes(damaged)
        with pytest.raises(DataError, match=r"0\.ppm: not an image that can be read"):
            read_picture(tmp_path / "0.ppm")


@pytest.mark.parametrize("mode", ["L", "LA", "P", "1", "RGB", "RGBA"])
def test_png_of_every_mode(tmp_path: Path, mode: str) -> None:
    picture = Image.fromarray(codes((6, 8, 3))).convert(mode)
    picture.save(tmp_path / "a.png")
    expected = np.asarray(picture.convert("L" if mode in ("L", "LA", "1") else "RGB"))
    pixels = read_picture(tmp_path / "a.png").pixels
    if pixels.ndim > expected.ndim:
        expected = np.repeat(expected[..., None], 3, axis=-1)
    np.testing.assert_array_equal(pixels, expected)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("shape", [(6, 8), (6, 8, 3)])
@pytest.mark.parametrize("compression", [None, "zlib"])
def test_tiff_by_another_writer(tmp_path: Path, dtype, shape: tuple[int, ...], compression: str | None) -> None:
    rng = np.random.default_rng(0)
    picture = rng.uniform(0, 9, shape).astype(dtype) if dtype in (np.float32, np.float64) else codes(shape, dtype)
    photometric = "rgb" if len(shape) == 3 else "minisblack"
    tifffile.imwrite(tmp_path / "a.tif", picture, compression=compression, photometric=photometric)
    pixels = read_picture(tmp_path / "a.tif").pixels
    np.testing.assert_array_equal(pixels, picture)
    source = open_source(tmp_path, fps=1)
    assert source.describe()["transfer"] == ("linear" if pixels.dtype.kind == "f" else "srgb")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("big", [False, True], ids=["classic", "big"])
@pytest.mark.parametrize("byteorder", "<>")
def test_no_layout_of_a_tiff_is_read_for_another(tmp_path: Path, dtype: type, big: bool, byteorder: str) -> None:
    """Planes apart, white as 0, transparency beside grey: either what is stored, or a sentence."""
    path = tmp_path / "a.tif"
    stored = codes((24, 16, 3), np.uint8 if dtype is np.float32 else dtype).astype(dtype)
    grey, see_through = stored[..., 0], {"extrasamples": ["unassalpha"], "planarconfig": "contig"}
    refused = 0
    for written, meant, options in [
        (stored, stored, {"photometric": "rgb"}),
        (np.moveaxis(stored, -1, 0), stored, {"photometric": "rgb", "planarconfig": "separate"}),
        (grey, np.iinfo(np.uint8).max - grey, {"photometric": "miniswhite"}),
        (stored[..., :2], grey, {"photometric": "minisblack", **see_through}),
    ]:
        tifffile.imwrite(path, written, bigtiff=big, byteorder=byteorder, **options)
        try:
            assert np.array_equal(read_picture(path).pixels, meant)
        except DataError as error:
            refused += 1
            assert dtype != np.uint8 and f"a TIFF of {dtype(0).nbytes * 8} bits" in str(error)
    assert refused == (0 if dtype is np.uint8 else 3)


def packed_tiff(values: np.ndarray, bits: int) -> bytes:
    """A TIFF of codes [H, W, C] of so many bits, without gaps between them."""
    height, width, channels = values.shape
    single = np.unpackbits(values.astype(">u2").view(np.uint8).reshape(height, -1, 2), axis=-1)[..., 16 - bits :]
    rows = np.packbits(single.reshape(height, -1), axis=-1).tobytes()
    colour, end = 2 if channels == 3 else 1, 122
    tags = [
        (256, width), (257, height), (258, bits), (259, 1), (262, colour), (273, end + 6), (277, channels),
        (278, height), (279, len(rows)),
    ]  # fmt: skip
    entries = [struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags]
    if channels == 3:
        entries[2] = struct.pack("<HHII", 258, 3, 3, end)
    head = b"II*\0" + struct.pack("<IH", 8, len(tags)) + b"".join(entries) + bytes(4)
    assert len(head) == end
    return head + struct.pack("<3H", bits, bits, bits) + rows


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("bits", [10, 12, 14])
def test_a_tiff_of_codes_without_gaps_is_read_in_their_bits(tmp_path: Path, bits: int, channels: int) -> None:
    """White is the largest of them, and who says so besides says nothing else."""
    white = 2**bits - 1
    values = np.linspace(0, white, 24 * channels).astype(int).reshape((4, 6, channels))
    for k in range(2):
        (tmp_path / f"{k}.tif").write_bytes(packed_tiff(values, bits))
    np.testing.assert_array_equal(read_picture(tmp_path / "0.tif").pixels.reshape(values.shape), values)
    for transfer in ("linear", f"linear:{bits}bit"):
        source = open_source(tmp_path, fps=1, colour="rgb", transfer=transfer)
        first, _ = source.frames()
        np.testing.assert_allclose(first.light, np.broadcast_to(values / white, (4, 6, 3)), atol=1e-6)
        assert source.warnings == [] and source.describe()["bits"] == bits


def test_a_tiff_with_pages_is_a_clip(tmp_path: Path) -> None:
    stack = codes((5, 6, 8), np.uint16)
    path = tmp_path / "stack.tif"
    tifffile.imwrite(path, stack, photometric="minisblack")
    with pytest.raises(UsageError, match=r"--fps.*stack_timestamps\.npy"):
        open_source(path)
    frames = list(open_source(path, fps=100).frames())
    assert [frame.t_ns for frame in frames] == [10_000_000 * k for k in range(5)]
    for frame, page in zip(frames, stack, strict=True):
        np.testing.assert_array_equal(frame.light, code_table("srgb", 16)[page])
    (tmp_path / "stack_timestamps.txt").write_text("# unit: ms\n0\n1\n5\n6\n7\n")
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames(2)] == [5_000_000, 6_000_000, 7_000_000]
    assert source.duration_expected_s == 0.007


def test_tags_of_a_tiff_that_nobody_knows_are_not_spoken_of(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """As cameras and microscopes write them; OpenCV would say so of each tag of each file."""
    tifffile.imwrite(tmp_path / "clip.tif", codes((3, 8, 8)), photometric="minisblack", extratags=[(65000, "H", 1, 7)])
    source = open_source(tmp_path / "clip.tif", fps=25)
    assert len(list(source.frames())) == 3
    assert capfd.readouterr().err == ""


def test_pages_of_other_kinds_are_refused(tmp_path: Path) -> None:
    for second, said in ((np.zeros((6, 8), np.int32), "type int32"), (np.zeros((6, 9), np.uint8), "9x6 pixels")):
        with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
            for page in (codes((6, 8)), second):
                writer.write(page, photometric="minisblack")
        with pytest.raises(DataError, match=said):
            list(open_source(tmp_path / "a.tif", fps=1).frames())


def test_pages_are_read_some_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stack = codes((11, 6, 8))
    tifffile.imwrite(tmp_path / "stack.tif", stack, photometric="minisblack")
    read, calls = picture_files._read, []

    def counted(*arguments):
        calls.append(arguments)
        return read(*arguments)

    monkeypatch.setattr(picture_files, "AHEAD", 4 * 48)
    monkeypatch.setattr(picture_files, "_read", counted)
    source = open_source(tmp_path / "stack.tif", fps=1)
    calls.clear()
    for frame, page in zip(source.frames(), stack, strict=True):
        np.testing.assert_array_equal(frame.light, code_table("srgb", 8)[page])
    assert len(calls) == 2 * 3
    assert [f.t_ns for f in source.frames(9)] == [9 * 10**9, 10 * 10**9]


@pytest.mark.parametrize("suffix", ["hdr", "pfm"])
def test_radiance_and_pfm_are_light_as_they_stand(tmp_path: Path, suffix: str) -> None:
    light = np.random.default_rng(0).uniform(1, 3, (6, 8, 3)).astype(np.float32)
    cv2.imwrite(str(tmp_path / f"a.{suffix}"), light[..., ::-1])
    source = open_source(tmp_path, fps=1, colour="rgb")
    tolerance = 1 / 64 if suffix == "hdr" else 0  # RGBE has 8 bits of mantissa
    np.testing.assert_allclose(next(source.frames()).light, light, rtol=tolerance)
    assert source.describe()["transfer"] == "linear"


def test_light_of_radiance_is_that_of_the_scene_whatever_the_exposure_of_each_picture(tmp_path: Path) -> None:
    """A clip whose frames were made presentable one by one does not flicker."""
    light = np.random.default_rng(0).uniform(1, 3, (6, 8, 3)).astype(np.float32)
    for k, exposures in enumerate(([], ["4.0"], ["2.5e-1", " 0.5"], ["0"], ["x"])):
        product = np.prod([float(text) for text in exposures if text not in "0x"])
        cv2.imwrite(str(path := tmp_path / f"{k}.hdr"), light[..., ::-1] * np.float32(product))
        head, _, rest = path.read_bytes().partition(b"\n")
        path.write_bytes(b"\n".join([head, *(f"EXPOSURE={text}".encode() for text in exposures), rest]))
    frames = [frame.light for frame in open_source(tmp_path, fps=1, colour="rgb").frames()]
    for frame in frames:
        np.testing.assert_allclose(frame, frames[0], rtol=1 / 64)
    (tmp_path / "0.hdr").unlink()
    as_it_stands, other, *_ = (frame.light for frame in open_source(tmp_path, fps=1, colour="rgb").frames())
    np.testing.assert_allclose(as_it_stands, 4 * light, rtol=1 / 64)
    np.testing.assert_allclose(other, as_it_stands, rtol=1 / 64)


def test_a_folder_of_codes_and_light_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), codes((4, 4)))
    cv2.imwrite(str(tmp_path / "1.tif"), np.ones((4, 4), np.float32))
    with pytest.raises(DataError, match=r"1\.tif: float32 pixels, expected uint8"):
        list(open_source(tmp_path, fps=1).frames())


def test_hidden_files_are_no_images(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), codes((4, 4)))
    (tmp_path / "._0.png").write_bytes(b"resource fork")
    assert open_source(tmp_path, fps=1).frames_expected == 1


@pytest.mark.parametrize(("bits", "stored", "masks", "read"), [
    (24, 0, (), True),
    (32, 0, (), True),
    (32, 3, (0xFF0000, 0xFF00, 0xFF), True),
    (32, 3, (0xFF000000, 0xFF0000, 0xFF00), False),
    (16, 0, (), False),  # 5 bits of each
    (16, 3, (0xF800, 0x7E0, 0x1F), False),
])  # fmt: skip
def test_no_layout_of_a_bmp_is_read_for_another(tmp_path: Path, bits: int, stored: int, masks, read: bool) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (4, 8, bits // 8), np.uint8)  # (rows of whole 4 bytes)
    where = struct.pack(f"<{len(masks)}I", *masks)
    head = struct.pack("<IiiHHIIiiII", 40, 8, -4, 1, bits, stored, pixels.nbytes, 2835, 2835, 0, 0) + where
    begin = 14 + len(head)
    path = tmp_path / "a.bmp"
    path.write_bytes(b"BM" + struct.pack("<IHHI", begin + pixels.nbytes, 0, 0, begin) + head + pixels.tobytes())
    if read:
        np.testing.assert_array_equal(read_picture(path).pixels, pixels[..., 2::-1])
    else:
        with pytest.raises(DataError, match=rf"a\.bmp: a BMP of {bits} bits a pixel .* with 24 bits"):
            read_picture(path)


@pytest.mark.parametrize(("suffix", "kind"), [
    ("pgm", "P5"), ("pnm", "P5"), ("PNM", "P2"), ("ppm", "P6"), ("pam", "P7"), ("pbm", "P4"),
])  # fmt: skip
def test_netpbm_is_found_by_all_its_names(tmp_path: Path, suffix: str, kind: str) -> None:
    values = codes((4, 8, 3) if kind == "P6" else (4, 8))
    content = b"P4 8 4\n" + bytes(4) if kind == "P4" else pnm(kind, 255, values)
    (tmp_path / f"0.{suffix}").write_bytes(content)
    assert [frame.light.shape for frame in open_source(tmp_path, fps=1).frames()] == [(4, 8)]


# ---------------------------------------------------------------------------------------------------------- names lie


def test_the_content_decides_in_a_folder(tmp_path: Path) -> None:
    picture = np.kron(codes((3, 4)), np.ones((8, 8), np.uint8))
    cv2.imwrite(str(tmp_path / "a.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 100])
    (tmp_path / "a.jpg").rename(tmp_path / "0.png")
    cv2.imwrite(str(tmp_path / "b.tif"), picture)
    (tmp_path / "b.tif").rename(tmp_path / "1.jpg")
    OpenEXR.File({}, {"Y": np.full(picture.shape, 0.5, np.float32)}).write(str(tmp_path / "2.exr"))
    first, second = open_source(tmp_path, fps=1, stop=1).frames()
    np.testing.assert_allclose(first.light, code_table("srgb", 8)[picture], atol=0.02)
    np.testing.assert_array_equal(second.light, code_table("srgb", 8)[picture])
    (tmp_path / "2.exr").rename(tmp_path / "2.png")
    assert read_picture(tmp_path / "2.png").pixels[0, 0] == 0.5


def test_the_content_decides_for_a_file(tmp_path: Path, encode) -> None:
    film = encode("a.mkv", [codes((16, 16))] * 2)
    np.save(tmp_path / "b.npy", np.zeros((3, 4, 5), np.float32))
    np.savez(tmp_path / "c.npz", frames=np.zeros((4, 4, 5), np.float32), fps=10)
    aliases = [("a.mkv", "x.npy", 2), ("b.npy", "y.mp4", 3), ("c.npz", "z.npy", 4), ("a.mkv", "w.png", 2)]
    for original, alias, count in aliases:
        shutil.copy(tmp_path / original, tmp_path / alias)
        options = {"fps": 5} if original == "b.npy" else {}
        assert len(list(open_source(tmp_path / alias, **options).frames())) == count
    assert recognise(film) == "video"


@pytest.mark.parametrize("name", ["photo.png", "photo.mp4", "photo"])
def test_a_single_picture_says_what_can_be_done(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(cv2.imencode(".jpg", codes((16, 16)))[1].tobytes())
    with pytest.raises(UsageError, match=r"single picture.*--motion"):
        open_source(tmp_path / name)


PROFILE = np.random.default_rng(0).bytes(9999)  # no profile, but as large as those of printers


@pytest.mark.parametrize(("suffix", "profile"), [(".png", b""), (".png", PROFILE), (".gif", b"")])
def test_an_animation_is_a_video_of_the_light_of_its_pictures(tmp_path: Path, suffix: str, profile: bytes) -> None:
    """Also where it says so far behind its first bytes, and where it has a colour profile, of which PyAV frees the name
    twice."""
    pictures = [Image.fromarray(np.full((16, 16, 3), level, np.uint8)) for level in (30, 200)]
    more = {"icc_profile": profile} if profile else {}
    pictures[0].save(tmp_path / f"a{suffix}", save_all=True, append_images=pictures[1:], duration=40, **more)
    animated = [frame.light for frame in open_source(tmp_path / f"a{suffix}").frames()]
    (tmp_path / "still").mkdir()
    for number, picture in enumerate(pictures):
        picture.save(tmp_path / "still" / f"{number}.png")
    still = [frame.light for frame in open_source(tmp_path / "still", fps=25).frames()]
    np.testing.assert_allclose(np.array(animated), np.array(still), rtol=1e-6)
    (tmp_path / "b.png").write_bytes(cv2.imencode(".jpg", codes((16, 16)))[1].tobytes())


@pytest.mark.parametrize("mode", ["RGB", "RGBA"])
def test_what_moves_in_an_avif_is_read_and_not_the_still_beside_it(tmp_path: Path, mode: str) -> None:
    scenes = [Image.fromarray(np.full((24, 32, 3), 60 * k + 30, np.uint8)).convert(mode) for k in range(4)]
    if mode == "RGBA":  # (otherwise its writer leaves transparency out)
        for scene in scenes:
            scene.putalpha(128)
    scenes[0].save(tmp_path / "a.avif", save_all=True, append_images=scenes[1:], duration=[40, 80, 40, 40])
    source = open_source(tmp_path / "a.avif")
    frames = list(source.frames())
    assert [frame.t_ns // 10**6 for frame in frames] == [0, 40, 120, 160]
    expected = code_table("srgb", 8)[np.arange(4) * 60 + 30]
    np.testing.assert_allclose([frame.light.mean() for frame in frames], expected, rtol=0.05)
    assert len(source.warnings) == (mode == "RGBA")


@pytest.mark.parametrize("name", ["a.avif", "a.qoi", "a.sgi", "a.pcx"])
def test_pictures_that_only_ffmpeg_knows_say_what_can_be_done(tmp_path: Path, name: str) -> None:
    Image.fromarray(np.full((24, 32, 3), 30, np.uint8)).save(tmp_path / name)
    with pytest.raises(UsageError, match="single picture, of a kind that is not read; make a PNG"):
        open_source(tmp_path / name)


def test_motion_jpeg_goes_by_its_name(tmp_path: Path) -> None:
    jpeg = cv2.imencode(".jpg", codes((16, 16)))[1].tobytes()
    (tmp_path / "a.mjpg").write_bytes(jpeg * 5)
    assert len(list(open_source(tmp_path / "a.mjpg", fps=10).frames())) == 5


@pytest.mark.parametrize("orientation", range(1, 9))
def test_motion_jpeg_with_exif_is_turned_as_its_pictures_are(tmp_path: Path, orientation: int) -> None:
    """PyAV has no name for what FFmpeg says of EXIF, and for what is new in it."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(codes((16, 32))).save(tmp_path / "0.jpg", exif=exif)
    (tmp_path / "a.mjpg").write_bytes((tmp_path / "0.jpg").read_bytes() * 2)
    still, *_ = open_source(tmp_path, fps=10).frames()
    moving, *_ = open_source(tmp_path / "a.mjpg", fps=10, transfer="srgb").frames()
    assert moving.light == pytest.approx(still.light, abs=0.02)


# ---------------------------------------------------------------------------------------------------------- OpenEXR


def write_exr(path: Path, channels: dict[str, np.ndarray], **header: object) -> Path:
    OpenEXR.File(header, dict(channels)).write(str(path))  # (it changes what it is given)
    return path


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("letters", ["RGB", "RGBA", "Y", "YA"])
def test_exr_is_light_as_it_stands(tmp_path: Path, dtype, letters: str) -> None:
    rng = np.random.default_rng(0)
    channels = {letter: rng.uniform(0, 300, (6, 8)).astype(dtype) for letter in letters}
    write_exr(tmp_path / "a.exr", channels)
    grey, colour = (next(open_source(tmp_path, fps=1, colour=kind).frames()).light for kind in ("luminance", "rgb"))
    planes = [channels[c].astype(np.float64) for c in ("RGB" if "R" in letters else "YYY")]
    np.testing.assert_allclose(colour, np.dstack(planes), rtol=1e-6)
    np.testing.assert_allclose(
        grey, np.dstack(planes) @ np.array(BT709_WEIGHTS), rtol=1e-6 if dtype == np.float32 else 2e-3
    )


def test_half_floats_keep_their_precision_in_the_sum(tmp_path: Path) -> None:
    channels = {
        letter: np.full((4, 4), level, np.float16) for letter, level in zip("RGB", (1000, 0.01, 0.3), strict=True)
    }
    write_exr(tmp_path / "a.exr", channels)
    light = next(open_source(tmp_path, fps=1).frames()).light[0, 0]
    expected = sum(float(channels[c][0, 0]) * w for c, w in zip("RGB", BT709_WEIGHTS, strict=True))
    assert light == pytest.approx(expected, rel=1e-6)


def test_the_first_part_with_colour_counts(tmp_path: Path) -> None:
    depth, red = np.full((6, 8), 7, np.float32), np.full((6, 8), 0.25, np.float32)
    parts = [OpenEXR.Part({"name": "depth"}, {"Z": depth}), OpenEXR.Part({"name": "beauty"}, dict.fromkeys("RGB", red))]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    assert np.all(read_picture(tmp_path / "a.exr").pixels == 0.25)
    write_exr(tmp_path / "b.exr", {"Layer.Depth.Z": depth} | {f"Layer.Combined.{c}": red for c in "RGBA"})
    assert np.all(read_picture(tmp_path / "b.exr").pixels == 0.25)
    write_exr(tmp_path / "c.exr", {"Z": depth})
    with pytest.raises(DataError, match=r"c\.exr: EXR with the channels Z"):
        read_picture(tmp_path / "c.exr")


def test_the_display_window_is_what_is_seen(tmp_path: Path) -> None:
    light = np.random.default_rng(0).uniform(1, 2, (6, 8)).astype(np.float32)
    windows = {
        "dataWindow": (np.array([2, -1], np.int32), np.array([9, 4], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([7, 9], np.int32)),
    }
    write_exr(tmp_path / "a.exr", {"Y": light}, **windows)
    expected = np.zeros((10, 8), np.float32)
    expected[0:5, 2:8] = light[1:, :6]
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr").pixels, expected)


def test_chromaticities_hold(tmp_path: Path) -> None:
    """ACEScg green in BT.709, against the matrix published with ACES (Bradford, D60 to D65)."""
    ap1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
    zero, one = np.zeros((4, 4), np.float32), np.ones((4, 4), np.float32)
    write_exr(tmp_path / "a.exr", {"R": zero, "G": one, "B": zero}, chromaticities=ap1)
    (frame,) = open_source(tmp_path, fps=1, colour="rgb").frames()
    np.testing.assert_allclose(frame.light[0, 0], [-0.62179, 1.14080, -0.12897], atol=2e-3)


def test_without_the_package_exr_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_exr(tmp_path / "a.exr", {"Y": np.ones((4, 4), np.float32)})
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(UsageError, match=r"a\.exr: EXR needs .*pip install 'vid2ev\[formats\]'"):
        open_source(tmp_path, fps=1)


@pytest.mark.parametrize("length", [4, 30, 200, 1500])
def test_a_cut_off_exr_is_refused(tmp_path: Path, length: int) -> None:
    path = write_exr(tmp_path / "a.exr", {"Y": np.random.default_rng(0).uniform(size=(40, 40)).astype(np.float32)})
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(DataError, match=r"a\.exr: "):
        open_source(tmp_path, fps=1)


def test_real_hdr_photographs() -> None:
    folder = Path(__file__).parents[2] / ".." / "shared" / "data" / "hdr"
    if not folder.is_dir():
        pytest.skip("the HDR photographs are not here (../shared/data/hdr)")
    for name, size, brightest in (("Desk.exr", (874, 644), 202), ("adams_place_bridge_1k.hdr", (512, 1024), 111)):
        pixels = read_picture(folder / name).pixels
        assert pixels.shape[:2] == size and pixels.dtype.kind == "f"
        assert float((pixels.astype(np.float64) @ BT709_WEIGHTS).max()) == pytest.approx(brightest, rel=0.01)


def test_an_animated_webp_is_no_single_picture(tmp_path: Path) -> None:
    first, *rest = (Image.fromarray(np.full((6, 8, 3), level, np.uint8)) for level in (0, 128, 255))
    first.save(tmp_path / "a.webp", save_all=True, append_images=rest, duration=40, lossless=True)
    if av.library_versions["libavformat"] < (63,):
        with pytest.raises(DataError, match=r"a\.webp: an animated WebP"):
            open_source(tmp_path / "a.webp")
    else:
        frames = list(open_source(tmp_path / "a.webp").frames())
        assert [frame.t_ns for frame in frames] == [0, 40_000_000, 80_000_000]
        assert [frame.light.mean() for frame in frames] == pytest.approx([0, 0.2158605, 1], rel=1e-6)
    with pytest.raises(UsageError, match="is for a photograph"):
        open_source(tmp_path / "a.webp", motion="pan")
    first.save(tmp_path / "a.webp", lossless=True)
    with pytest.raises(UsageError, match="a single picture"):
        open_source(tmp_path / "a.webp")


# ---------------------------------------------------------------------------------------------------------- names


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "webp", "jp2", "hdr", "pfm", "exr"])
def test_a_picture_whose_name_is_not_utf8_is_read_as_any_other(tmp_path: Path, suffix: str) -> None:
    """In a process of its own: OpenCV ended the program at such a name."""
    light = np.random.default_rng(0).uniform(1, 3, (6, 8, 3)).astype(np.float32)
    plain = tmp_path / f"a.{suffix}"
    if suffix == "exr":
        OpenEXR.File({}, {name: light[..., k].copy() for k, name in enumerate("RGB")}).write(str(plain))
    else:
        cv2.imwrite(str(plain), light if suffix in ("hdr", "pfm") else codes((64, 64, 3)))
    try:
        shutil.copy(plain, os.fsencode(tmp_path) + f"/\xff.{suffix}".encode("latin-1"))
    except OSError:
        pytest.skip("names are UTF-8 here")
    program = (
        "import numpy as np, os, sys; from pathlib import Path; from vid2ev.light.picture_files import *;"
        f"folder = Path(sys.argv[1]); other = folder / os.fsdecode(b'\\xff.{suffix}');"
        f"one, two = (read_picture(path).pixels for path in (folder / 'a.{suffix}', other));"
        "assert one.dtype == two.dtype and (one == two).all(); print(pages_of(other))"
    )
    done = subprocess.run([sys.executable, "-c", program, tmp_path], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stdout, done.stderr) == (0, "1\n", "")


def test_a_stack_whose_name_is_not_in_the_locale_is_a_clip(tmp_path: Path) -> None:
    """UTF-8, where the locale is ASCII: OpenCV looked for a file of another name."""
    path = os.fsencode(tmp_path) + b"/\xc3\xbc.tif"
    tifffile.imwrite(tmp_path / "a.tif", codes((3, 6, 8)), photometric="minisblack")
    shutil.move(tmp_path / "a.tif", path)
    program = (
        "import sys; from vid2ev.sources import open_source;print(len(list(open_source(sys.argv[1], fps=10).frames())))"
    )
    ascii_only = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    arguments = [sys.executable, "-c", program, path]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=100, env=ascii_only)
    assert (done.returncode, done.stdout, done.stderr) == (0, "3\n", "")


def test_a_name_that_is_not_utf8_needs_a_place_for_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(DataError, match=r"not UTF-8.*No such file.*rename it"), plain_name(tmp_path / "\udcff.png"):
        pass
