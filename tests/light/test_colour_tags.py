"""Colour tags of PNG, and profiles of others, in files put together by hand."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from vid2ev import open_source
from vid2ev.errors import DataError
from vid2ev.light.icc import profile_name
from vid2ev.light.picture_files import read_picture
from vid2ev.light.primaries import primaries_of
from vid2ev.light.transfer import parse_transfer
from vid2ev.untrusted import png_chunks

SRGB = struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)
BT2020 = struct.pack(">8I", 31270, 32900, 70800, 29200, 17000, 79700, 13100, 4600)


def png(path: Path, pixels: np.ndarray, *tags: tuple[bytes, bytes]) -> Path:
    """RGB of 8 bits, with chunks before the pixels."""
    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    head = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", head), *tags, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    made = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    ]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(made))
    return path


def test_the_parts_of_a_png_go_to_its_end_or_that_of_the_file(tmp_path: Path) -> None:
    path = png(tmp_path / "a.png", np.zeros((4, 5, 3), np.uint8), (b"gAMA", b"1234"))
    whole = path.read_bytes()
    path.write_bytes(whole + b"what comes after the end")
    with open(path, "rb") as file:
        found = {kind: file.read(length) for kind, length, _ in png_chunks(file)}
    assert list(found) == [b"IHDR", b"gAMA", b"IDAT", b"IEND"]
    assert found[b"gAMA"] == b"1234" and zlib.decompress(found[b"IDAT"]) == bytes(64)
    for size in range(len(whole) + 1):
        path.write_bytes(whole[:size])
        with open(path, "rb") as file:
            *before, last = [0, *(end for *_, end in png_chunks(file))]
        assert max(before, default=0) <= size and (last > size) == (size > 8 and size != last)


@pytest.mark.parametrize(
    ("tags", "transfer", "primaries"),
    [
        ([], None, None),
        ([(b"cICP", bytes([9, 16, 0, 1]))], "pq", 9),
        ([(b"cICP", bytes([1, 1, 0, 1]))], "bt709", 1),
        ([(b"gAMA", struct.pack(">I", 45455)), (b"cHRM", SRGB)], None, 1),
        ([(b"gAMA", struct.pack(">I", 100000)), (b"cHRM", BT2020)], "linear", 9),
        ([(b"gAMA", struct.pack(">I", 50000))], "gamma:2", None),
        ([(b"gAMA", struct.pack(">I", 50000)), (b"sRGB", b"\0")], None, None),
        ([(b"iCCP", b"x\0\0" + bytes(5000)), (b"cICP", bytes([12, 13, 0, 1]))], "srgb", 12),
        ([(b"gAMA", struct.pack(">I", 0)), (b"cHRM", bytes(32))], None, None),
        ([(b"gAMA", b"\1"), (b"cHRM", bytes(3)), (b"cICP", b"\1")], None, None),
        ([(b"gAMA", struct.pack(">I", 1))], None, None),
    ],
)
def test_a_png_says_what_its_codes_stand_for(
    tmp_path: Path, tags: list[tuple[bytes, bytes]], transfer: str | None, primaries: int | None
) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    found = read_picture(png(tmp_path / "one.png", pixels, *tags))
    assert (found.pixels == pixels).all() and found.transfer == transfer
    if primaries is None:
        assert found.primaries is None
    else:
        assert found.primaries is not None
        np.testing.assert_allclose(found.primaries.to_bt709, primaries_of(primaries).to_bt709, atol=2e-3)


def test_a_folder_of_them_is_read_so_unless_told_otherwise(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 3), 128, np.uint8)
    for k in range(2):
        png(tmp_path / f"{k}.png", pixels, (b"cICP", bytes([1, 16, 0, 1])))
    for asked, curve in (("auto", "pq"), ("srgb", "srgb")):
        source = open_source(tmp_path, fps=10, transfer=asked)
        assert source.describe()["transfer"] == curve
        light = next(iter(source.frames())).luminance
        assert light == pytest.approx(float(parse_transfer(curve).to_light(np.array(128 / 255))), rel=1e-5)


@pytest.mark.parametrize(
    ("tag", "remark"),
    [
        ((b"iCCP", b"Display P3\0\0" + bytes(500)), "its ICC profile 'Display P3' is not read"),
        ((b"iCCP", b"sRGB IEC61966-2.1\0\0" + bytes(500)), None),
        ((b"cICP", bytes([9, 16, 0, 0])), "codes of limited range"),
        ((b"cICP", bytes([9, 99, 0, 1])), "transfer curve 99 of H.273 is not known"),
        ((b"cICP", bytes([9, 16, 0, 1])), None),
        ((b"gAMA", struct.pack(">I", 50000)), None),
    ],
)
def test_what_is_not_taken_up_of_tags_is_said(tmp_path: Path, tag: tuple[bytes, bytes], remark: str | None) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (40, 40, 3), np.uint8)
    one = png(tmp_path / "one.png", pixels, tag)
    for source in (open_source(tmp_path, fps=10), open_source(one, motion="pan:speed=1")):
        assert len(source.warnings) == (remark is not None) and (remark or "") in "".join(source.warnings)
    assert open_source(tmp_path, fps=10, transfer="srgb").warnings == []  # (who says something is believed)


def test_pictures_of_one_folder_are_coded_alike(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 3), 128, np.uint8)
    png(tmp_path / "0.png", pixels, (b"sRGB", b"\0"))
    png(tmp_path / "1.png", pixels)
    png(tmp_path / "2.png", pixels, (b"gAMA", struct.pack(">I", 100000)))
    with pytest.raises(DataError, match=r"2\.png: codes of linear by its tags, expected srgb like those of the first"):
        list(open_source(tmp_path, fps=10).frames())
    assert len(list(open_source(tmp_path, fps=10, transfer="srgb").frames())) == 3


def profile(name: str, text: str) -> bytes:
    """An ICC profile that is no more than its name, in a text as of before 2010 or as since."""
    if text == "desc":
        tag = b"desc" + bytes(4) + struct.pack(">I", len(name) + 1) + name.encode() + b"\0"
    else:
        tag = (
            b"mluc"
            + bytes(4)
            + struct.pack(">II2s2sII", 1, 12, b"en", b"US", 2 * len(name), 28)
            + name.encode("utf-16-be")
        )
    return bytes(128) + struct.pack(">I4sII", 1, b"desc", 144, len(tag)) + tag


def jpeg(path: Path, pixels: np.ndarray, held: bytes) -> Path:
    coded = cv2.imencode(".jpg", pixels)[1].tobytes()
    part = b"ICC_PROFILE\0\1\1" + held
    path.write_bytes(coded[:2] + b"\xff\xe2" + struct.pack(">H", len(part) + 2) + part + coded[2:])
    return path


def png_of_pillow(path: Path, pixels: np.ndarray, held: bytes) -> Path:
    """Pillow calls all profiles the same in their tag."""
    Image.fromarray(pixels).save(path.with_suffix(".png"), icc_profile=held)
    return path


def filled_jpeg(path: Path, pixels: np.ndarray, held: bytes) -> Path:
    """With bytes FF before a mark, of which there may be any number (T.81, B.1.1.2)."""
    whole = jpeg(path, pixels, held).read_bytes()
    path.write_bytes(whole[:2] + 3 * b"\xff" + whole[2:])
    return path


def tiff(path: Path, pixels: np.ndarray, held: bytes) -> Path:
    """Grey, little endian, without compression."""
    height, width = pixels.shape[:2]
    entries = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8),
               (278, 4, 1, height), (279, 4, 1, height * width), (34675, 7, len(held), 8 + height * width)]  # fmt: skip
    body = pixels[..., 0].tobytes() + held
    table = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", *each) for each in entries) + bytes(4)
    path.write_bytes(b"II*\0" + struct.pack("<I", 8 + len(body)) + body + table)
    return path


@pytest.mark.parametrize("write", [jpeg, filled_jpeg, tiff, png_of_pillow])
@pytest.mark.parametrize("text", ["desc", "mluc"])
@pytest.mark.parametrize(("name", "said"), [("Display P3", True), ("sRGB IEC61966-2.1", False), ("c2", False)])
def test_a_profile_that_is_not_read_is_named(
    tmp_path: Path, write: Callable[..., Path], text: str, name: str, said: bool
) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (40, 40, 3), np.uint8)
    write(tmp_path / f"one.{write.__name__.removeprefix('filled_')}", pixels, profile(name, text))
    warnings = open_source(tmp_path, fps=10).warnings
    assert len(warnings) == said and ("its ICC profile 'Display P3' is not read" in "".join(warnings)) == said


@settings(max_examples=60)
@given(st.binary(max_size=200), st.sampled_from(["desc", "mluc"]), st.integers(0, 180))
def test_damaged_profiles_are_names_or_nothing(noise: bytes, text: str, at: int) -> None:
    held = bytearray(profile("Display P3", text))
    held[at : at + len(noise)] = noise
    with TemporaryDirectory() as folder:
        for write in (jpeg, tiff):
            name = profile_name(write(Path(folder) / "one", np.zeros((16, 16, 3), np.uint8), bytes(held)))
            assert name is None or (len(name) <= 60 and name.isprintable())
