"""Videos: exact times, exact light, the right way up, and what is wrong with a file in one sentence."""

from __future__ import annotations

import re
import struct
import wave
import weakref
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from vid2ev.commands.summary import source_text
from vid2ev.errors import DataError, UsageError
from vid2ev.light.transfer import parse_transfer
from vid2ev.sources import footage, open_source
from vid2ev.sources.kept import Kept

LIMITED, FULL = 1, 2


def light_of(signal: np.ndarray, transfer: str = "bt709") -> np.ndarray:
    return parse_transfer(transfer).to_light(signal)


def flat(codes: list[int], shape: tuple[int, int] = (32, 48)) -> list[np.ndarray]:
    return [np.full(shape, code, np.uint8) for code in codes]


def chroma_too(code: int) -> av.VideoFrame:
    """A grey picture in yuv420p, for codecs that have no grey."""
    return av.VideoFrame.from_ndarray(flat([code])[0], format="gray").reformat(format="yuv420p")


# ---------------------------------------------------------------------------------------------------------- times


@pytest.mark.parametrize(
    "rate", [Fraction(24000, 1001), Fraction(30000, 1001), Fraction(25), Fraction(240), Fraction(7)]
)
def test_times_are_the_nearest_nanosecond_of_exact_fractions(encode, rate: Fraction) -> None:
    path = encode("a.mp4", flat([k * 4 for k in range(40)]), codec="libx264", time_base=1 / rate)
    times = [frame.t_ns for frame in open_source(path).frames()]
    assert len(times) == 40
    for k, t_ns in enumerate(times):
        assert abs(t_ns - k / rate * 10**9) <= Fraction(1, 2)


def test_variable_rate_and_reordered_frames(encode) -> None:
    """B-frames are stored out of order; each frame must come with its own time, whatever the spacing."""
    stamps = [0, 1, 5, 6, 7, 400, 401, 9000, 90000, 90001, 90005, 90090]
    levels = [20 * k + 10 for k in range(len(stamps))]
    options = {"bf": "3", "crf": "1", "x264-params": "b-adapt=0:scenecut=0"}
    path = encode("a.mp4", flat(levels), codec="libx264", stamps=stamps, time_base=Fraction(1, 90000), options=options)
    with av.open(str(path)) as container:
        kinds = {frame.pict_type for frame in container.decode(video=0)}
    assert len(kinds) == 3, "no B-frames: the test tests nothing"
    frames = list(open_source(path).frames())
    assert [frame.t_ns for frame in frames] == [(2 * s * 10**9 + 90000) // 180000 for s in stamps]
    brightness = [frame.light.mean() for frame in frames]
    assert brightness == sorted(brightness) and len(set(brightness)) == len(levels)


def test_no_frame_of_h264_in_avi_is_lost_for_its_stamp(encode) -> None:
    """AVI stamps packets in the order of decoding, so that those of B-frames run back in the order of presentation."""
    options = {"bf": "16", "crf": "1", "x264-params": "b-adapt=0:scenecut=0"}
    path = encode("a.avi", flat([5 * k + 10 for k in range(40)]), codec="libx264", options=options)
    with av.open(str(path)) as container:
        stamps = [picture.pts for picture in container.decode(video=0)]
    assert stamps != sorted(stamps), "in order by themselves: the test tests nothing"
    source = open_source(path)
    frames = list(source.frames())
    assert len(frames) == source.frames_expected == 40 and not source.warnings
    steps_ns = np.diff([frame.t_ns for frame in frames])
    assert steps_ns.min() == 33_333_333 and steps_ns.max() == 33_333_334
    brightness = [frame.light.mean() for frame in frames]
    assert brightness == sorted(brightness) and len(set(brightness)) == 40
    assert [frame.t_ns for frame in source.frames(7)] == [frame.t_ns for frame in frames[7:]]


def test_pictures_that_stand_alone_do_not_wait_for_others_in_avi(encode, make_picture, stamps_passing) -> None:
    grey = [np.full((side, side), 128, np.uint8) for side in (16, 8, 8)]
    stills = [make_picture(grey, "yuvj420p") for _ in range(25)]
    source = open_source(encode("a.avi", stills, codec="mjpeg"))
    seen = stamps_passing("_of_packets")
    next(source.frames())
    assert len(seen) == 1


def test_a_clip_that_starts_late_keeps_its_times(encode) -> None:
    hours = 3 * 3600 * 1000
    path = encode("a.mkv", flat([1, 2, 3]), stamps=[hours, hours + 33, hours + 66], time_base=Fraction(1, 1000))
    times = [frame.t_ns for frame in open_source(path).frames()]
    assert times == [(hours + k) * 1_000_000 for k in (0, 33, 66)]


def with_edits(path: Path, edits: list[tuple[int, int]]) -> Path:
    """An MP4 by libavformat whose edit list is another: (how long [ms], from which tick of the stream on, -1 for
    nothing) each.  Source: ISO/IEC 14496-12 sections 8.6.5 and 8.6.6."""

    def box(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I4s", 8 + len(content), kind) + content

    entries = b"".join(struct.pack(">Iihh", *edit, 1, 0) for edit in edits)
    data = path.read_bytes()
    moov, trak, edts = (data.rindex(kind) - 4 for kind in (b"moov", b"trak", b"edts"))
    made = box(b"edts", box(b"elst", struct.pack(">II", 0, len(edits)) + entries))
    (old,) = struct.unpack_from(">I", data, edts)
    changed = bytearray(data[:edts] + made + data[edts + old :])
    for outer in (moov, trak):  # (which is behind the pictures, so these stay where they are)
        struct.pack_into(">I", changed, outer, struct.unpack_from(">I", data, outer)[0] + len(made) - old)
    path.write_bytes(changed)
    return path


@pytest.mark.parametrize("reordered", [0, 2])
@pytest.mark.parametrize(("edits", "shown"), [
    ([(480, 0)], range(12)),
    ([(400, -1), (480, 0)], range(12)),  # begins late
    ([(320, 4)], range(4, 12)),  # its beginning is cut off
    ([(200, 0)], range(5)),  # its end is
    ([(200, -1), (280, 3)], range(3, 10)),
    ([(160, 8), (160, 0)], [8, 9, 10, 11, 0, 1, 2, 3]),
    ([(120, 3), (120, 3)], [3, 4, 5, 3, 4, 5]),
])  # fmt: skip
def test_an_edit_list_says_what_is_shown_and_when(encode, reordered: int, edits, shown) -> None:
    """Frames that it hides are none that are missing."""
    options = {"bf": str(reordered), "crf": "1", "g": "6"}
    path = encode(
        "a.mp4", flat([20 * k + 10 for k in range(12)]), codec="libx264", time_base=Fraction(1, 25), options=options
    )
    whole = [frame.light for frame in open_source(path).frames()]
    with av.open(str(path)) as container:
        tick_s = container.streams.video[0].time_base
    first, frame = (Fraction(k, 25) / tick_s for k in (min(reordered, 2), 1))  # (stored as so much late)
    with_edits(path, [(ms, -1 if k < 0 else int(first + k * frame)) for ms, k in edits])
    begin_ms = edits[0][0] if edits[0][1] < 0 else 0
    source = open_source(path)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [(begin_ms + 40 * k) * 10**6 for k in range(len(shown))]
    for seen, k in zip(frames, shown, strict=True):
        np.testing.assert_array_equal(seen.light, whole[k])
    assert source.warnings == [] and source.frames_expected == len(shown)
    assert len(list(open_source(path, start=frames[2].t_ns / 1e9).frames())) == len(shown) - 2


@pytest.mark.parametrize("begin_s", [0, Fraction(1, 10), 5, 100_000])
@pytest.mark.parametrize("name", ["a.mp4", "a.mkv", "a.webm", "a.ts"])
def test_what_a_header_says_counts_from_the_first_frame(encode, name: str, begin_s: int) -> None:
    """Containers write how long a clip lasts, Matroska where it ends."""
    codec = {"a.mkv": "ffv1", "a.webm": "libvpx-vp9"}.get(name, "libx264")
    pictures = [chroma_too(code) for code in range(0, 100, 10)] if name == "a.webm" else flat([*range(0, 100, 10)])
    source = open_source(
        encode(name, pictures, codec=codec, stamps=[int(30 * begin_s) + k for k in range(10)], options={"bf": "0"})
    )
    times = [frame.t_ns for frame in source.frames()]
    if name != "a.ts":  # (whose muxer begins later)
        assert times[0] == begin_s * 10**9
    assert source.frames_expected == len(times) == 10
    assert source.duration_expected_s == pytest.approx(1 / 3, abs=0.005)
    assert source.warnings == []


def test_matroska_by_others_says_how_long_it_lasts(encode) -> None:
    """As mkvmerge writes it: from the first frame to the end, which libavformat counts from 0."""
    path = encode("a.mkv", flat([*range(0, 200, 2)]), stamps=[30 + k for k in range(100)])
    data, end, length = path.read_bytes(), b"00:00:04.33", b"00:00:03.33"
    assert data.count(end) == 1 and data.count(b"Lavf") > 0
    path.write_bytes(data.replace(end, length).replace(b"Lavf", b"mux "))
    source = open_source(path)
    assert source.frames_expected == 100 and source.duration_expected_s == pytest.approx(10 / 3, abs=0.01)


def test_repeated_times_are_dropped_and_counted(encode) -> None:
    # Matroska rounds to milliseconds: four frames in 0.4 ms become repeats.
    stamps = [0, 1000, 1001, 1002, 1003, 2000]
    path = encode("a.mkv", flat([10, 20, 30, 40, 50, 60]), stamps=stamps, time_base=Fraction(1, 10000))
    source = open_source(path)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == [0, 100_000_000, 200_000_000]
    assert source.warnings == ["dropped 3 of 6 frames whose time is not after the frame before"]
    (last,) = source.frames(2)
    assert last.t_ns == 200_000_000 and len(source.warnings) == 1


def test_a_stream_without_times_is_placed_by_its_rate(encode) -> None:
    path = encode("a.h264", flat([10, 20, 30]), codec="libx264", time_base=Fraction(1, 25))
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames()] == [0, 40_000_000, 80_000_000]
    assert "placed at 25 fps: 3 frames without a presentation time" in source.warnings[0]
    assert [frame.t_ns for frame in open_source(path, fps=1000).frames()] == [0, 1_000_000, 2_000_000]


def test_fps_overrules_the_file(encode) -> None:
    path = encode("a.mkv", flat([1, 2, 3]), stamps=[0, 5, 90])
    assert [frame.t_ns for frame in open_source(path, fps=1000).frames()] == [0, 1_000_000, 2_000_000]


def test_start_is_a_place_in_the_whole(encode) -> None:
    options = {"bf": "2", "g": "8"}
    path = encode("a.mp4", flat([7 * k for k in range(30)]), codec="libx264", options=options)
    source = open_source(path)
    whole = list(source.frames())
    for start in (0, 1, 8, 29):
        rest = list(source.frames(start))
        assert [frame.t_ns for frame in rest] == [frame.t_ns for frame in whole[start:]]
        assert all(np.array_equal(a.light, b.light) for a, b in zip(rest, whole[start:], strict=True))
    assert list(source.frames(30)) == []


# ---------------------------------------------------------------------------------------------------------- light


def test_ten_bits_arrive_as_ten_bits(encode, make_picture) -> None:
    ramp = np.arange(64, 941, dtype=np.uint16)[None, :].repeat(4, axis=0)
    ramp = np.concatenate([ramp, ramp[:, -1:]], axis=1)
    neutral = np.full((2, ramp.shape[1] // 2), 512, np.uint16)
    path = encode("a.mkv", [make_picture([ramp, neutral, neutral], "yuv420p10le", color_range=LIMITED)])
    source = open_source(path)
    (frame,) = source.frames()
    assert source.describe()["bits"] == 10
    assert len(np.unique(frame.light)) == 877  # of 219 * 4 + 1 levels
    np.testing.assert_allclose(frame.light[1], light_of((ramp[1] / 4.0 - 16) / 219), atol=6e-7)


def test_eight_bits_of_luma_are_not_rounded_again(encode, make_picture) -> None:
    """Through 8-bit RGB, 220 levels of limited range would fall on uneven steps of 256."""
    ramp = np.arange(16, 236, dtype=np.uint8)[None, :].repeat(2, axis=0)
    neutral = np.full((1, 110), 128, np.uint8)
    (frame,) = open_source(encode("a.mkv", [make_picture([ramp, neutral, neutral], "yuv420p")])).frames()
    np.testing.assert_allclose(frame.light[0], light_of((ramp[0] - 16.0) / 219), atol=6e-7)


@pytest.mark.parametrize("depth", [8, 10, 12])
def test_full_and_limited_range_agree(encode, make_picture, depth: int) -> None:
    """The same signal coded both ways, to within half a code of each."""
    rng = np.random.default_rng(0)
    signal, chroma = rng.uniform(0.2, 0.8, (16, 16)), rng.uniform(-0.1, 0.1, (2, 16, 16))
    unit, top = 2.0 ** (depth - 8), 2**depth - 1
    name, dtype = ("yuv444p", np.uint8) if depth == 8 else (f"yuv444p{depth}le", np.uint16)
    lights = []
    for color_range in (FULL, LIMITED):
        if color_range == FULL:
            planes = [signal * top, *(c * top + 128 * unit for c in chroma)]
        else:
            planes = [(16 + 219 * signal) * unit, *((128 + 224 * c) * unit for c in chroma)]
        coded = make_picture([np.rint(p).astype(dtype) for p in planes], name, color_range=color_range, colorspace=1)
        path = encode(f"{color_range}.mkv", [coded], color_range=color_range, colorspace=1)
        source = open_source(path)
        assert source.describe()["range"] == ("full" if color_range == FULL else "limited")
        lights.append(next(source.frames()).light)
    np.testing.assert_allclose(lights[0], lights[1], atol=5.0 / (219 * unit))
    assert abs(np.mean(lights[0] - lights[1])) < 0.3 / (219 * unit)


@pytest.mark.parametrize(("pixel_format", "bits"), [
    ("gray", 8), ("gray10le", 10), ("gray16le", 16), ("gbrp", 8), ("gbrp10le", 10), ("gbrp16le", 16),
])  # fmt: skip
def test_grey_and_rgb_are_full_range_and_exact(encode, make_picture, pixel_format: str, bits: int) -> None:
    rng = np.random.default_rng(0)
    dtype = np.uint8 if bits == 8 else np.uint16
    count = 3 if pixel_format.startswith("g") and "b" in pixel_format else 1
    planes = [rng.integers(0, 2**bits, (8, 10)).astype(dtype) for _ in range(count)]
    codec = {"gbrp": "rawvideo"}.get(pixel_format, "ffv1")
    source = open_source(encode("a.nut", [make_picture(planes, pixel_format)], codec=codec))
    green, blue, red = (light_of(p / (2.0**bits - 1)) for p in (planes if count == 3 else planes * 3))
    (frame,) = source.frames()
    np.testing.assert_allclose(frame.light, 0.2126 * red + 0.7152 * green + 0.0722 * blue, atol=6e-7)


def test_packed_and_semi_planar_formats_are_taken_apart_without_loss(make_picture) -> None:
    from vid2ev.sources.planes import planar

    rng = np.random.default_rng(0)
    y, u, v = (rng.integers(0, 256, shape).astype(np.uint8) for shape in ((8, 16), (4, 8), (4, 8)))
    woven = np.stack([u, v], axis=-1).reshape(4, 16)
    for color_range in (0, LIMITED, FULL):
        taken = planar(make_picture([y, woven], "nv12", color_range=color_range), "clip")
        assert taken.format.name == "yuv420p" and taken.color_range == color_range
        for plane, expected in zip(taken.planes, (y, u, v), strict=True):
            got = np.frombuffer(plane, np.uint8).reshape(plane.height, -1)[:, : expected.shape[1]]
            np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize(("pixel_format", "bits"), [
    ("rgb565le", (5, 6, 5)), ("rgb555be", (5, 5, 5)), ("rgb444le", (4, 4, 4)), ("rgb8", (3, 3, 2)),
    ("rgb4_byte", (1, 2, 1)),
])  # fmt: skip
def test_white_of_few_bits_is_white(make_picture, pixel_format: str, bits: tuple[int, int, int]) -> None:
    """Codes of 5 bits are 31sts: shifted to 8 bits, white is 248, and tinted beside the 252 of 6 bits."""
    from vid2ev.sources.planes import planar

    low = np.cumsum((0, *bits[:0:-1]))[::-1]  # where red, green and blue begin, blue at the lowest bit
    words = np.arange(2 ** sum(bits)).reshape(-1, min(2 ** sum(bits), 64))
    stored = words.astype({"le": "<u2", "be": ">u2"}.get(pixel_format[-2:], "u1"))
    taken = planar(make_picture([stored], pixel_format), "clip")
    for plane, k in zip(taken.planes, (1, 2, 0), strict=True):
        got = np.frombuffer(plane, np.uint8).reshape(plane.height, -1)[:, : words.shape[1]]
        most = 2 ** bits[k] - 1
        np.testing.assert_allclose(got, (words >> low[k] & most) * (255 / most), atol=0.5)


@pytest.mark.parametrize("pixel_format", ["y210be", "grayf32le", "bayer_rggb8"])
def test_formats_that_cannot_be_taken_apart_are_refused(pixel_format: str) -> None:
    from vid2ev.sources.planes import planar

    with pytest.raises(DataError, match=f"pixel format {pixel_format} is not supported"):
        planar(av.VideoFrame(16, 16, pixel_format), "clip")


@pytest.mark.parametrize(("tags", "transfer"), [
    ({}, "bt709"),
    ({"color_trc": 1}, "bt709"),
    ({"color_trc": 13}, "srgb"),
    ({"color_trc": 4}, "gamma:2.2"),
    ({"color_trc": 5}, "gamma:2.8"),
    ({"color_trc": 7}, "smpte240m"),
    ({"color_trc": 8}, "linear"),
    ({"color_trc": 9}, "log100"),
    ({"color_trc": 10}, "log316"),
    ({"color_trc": 16}, "pq"),
    ({"color_trc": 17}, "st428"),
    ({"color_trc": 18}, "hlg"),
])  # fmt: skip
def test_the_tag_chooses_the_curve(encode, tags: dict[str, int], transfer: str) -> None:
    path = encode("a.mkv", flat([128]), **tags)
    source = open_source(path)
    assert source.describe()["transfer"] == transfer
    (frame,) = source.frames()
    np.testing.assert_allclose(frame.light, light_of(np.array(128 / 255), transfer), atol=1e-6)
    assert open_source(path, transfer="gamma:3").describe()["transfer"] == "gamma:3"


def test_matrix_and_primaries_are_those_of_the_tags(encode, make_picture) -> None:
    y, u, v = (np.full((4, 4), code, np.uint8) for code in (110, 90, 190))
    got = {}
    for matrix in (1, 6, 9):
        coded = make_picture([y, u, v], "yuv444p", colorspace=matrix, color_primaries=matrix)
        path = encode(f"{matrix}.mkv", [coded], colorspace=matrix, color_primaries=matrix)
        got[matrix] = float(next(open_source(path).frames()).light[0, 0])
    luma, cb, cr = (110 - 16) / 219, (90 - 128) / 224, (190 - 128) / 224
    for matrix, kr, kb, weights in (
        (1, 0.2126, 0.0722, (0.2126, 0.7152, 0.0722)),
        (6, 0.299, 0.114, (0.2124, 0.7011, 0.0866)),
        (9, 0.2627, 0.0593, (0.2627, 0.6780, 0.0593)),
    ):
        red, blue = luma + 2 * (1 - kr) * cr, luma + 2 * (1 - kb) * cb
        green = (luma - kr * red - kb * blue) / (1 - kr - kb)
        assert got[matrix] == pytest.approx(float(light_of(np.array([red, green, blue])) @ weights), abs=1e-4)
    assert len(set(got.values())) == 3


# ---------------------------------------------------------------------------------------------------------- upright


def with_display_matrix(path: Path, matrix: tuple[int, int, int, int]) -> Path:
    """The mp4 with the matrix a, b, c, d in its track header (ISO/IEC 14496-12 section 8.3.2)."""
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 40
    for place, value in zip((0, 1, 3, 4), matrix, strict=True):
        data[at + 4 * place : at + 4 * place + 4] = (value << 16).to_bytes(4, "big", signed=True)
    turned = path.with_name(f"turned{matrix}.mp4")
    turned.write_bytes(data)
    return turned


@pytest.mark.parametrize(("matrix", "turn"), [
    ((1, 0, 0, 1), lambda p: p),
    ((0, 1, -1, 0), lambda p: np.rot90(p, -1)),  # a telephone held upright: a quarter turn clockwise to show it
    ((-1, 0, 0, -1), lambda p: np.rot90(p, 2)),
    ((0, -1, 1, 0), lambda p: np.rot90(p, 1)),
    ((-1, 0, 0, 1), np.fliplr),
    ((1, 0, 0, -1), np.flipud),
    ((0, 1, 1, 0), np.transpose),
    ((0, -1, -1, 0), lambda p: np.rot90(p, 2).T),
])  # fmt: skip
def test_the_picture_is_upright(encode, matrix: tuple[int, int, int, int], turn: Callable[[Any], np.ndarray]) -> None:
    scene = np.full((32, 64), 50, np.uint8)
    scene[:16, :16], scene[:16, 48:], scene[16:, :32] = 230, 150, 90
    stored = encode("a.mp4", [scene] * 2, codec="libx264", options={"crf": "0", "bf": "0"})
    (upright, _) = open_source(stored).frames()
    path = with_display_matrix(stored, matrix)
    source = open_source(path)
    (frame, _) = source.frames()
    assert frame.light.shape == source.size[::-1] and frame.light.flags.c_contiguous
    np.testing.assert_array_equal(frame.light, turn(upright.light))
    with av.open(str(path)) as container:  # (FFmpeg's own reading of the angle, where there is no mirror)
        angle = next(container.decode(video=0)).rotation
    if matrix[0] * matrix[3] - matrix[1] * matrix[2] > 0:
        np.testing.assert_array_equal(frame.light, np.rot90(upright.light, angle // 90))


def test_pictures_that_a_decoder_writes_upwards_are_upright(encode, make_picture) -> None:
    """From the last row in memory to the first one, as that of AMV does."""
    luma, colour = np.full((32, 64), 40, np.uint8), np.full((16, 32), 128, np.uint8)
    luma[:16, :32] = 220
    stored = make_picture([luma, colour, colour], "yuvj420p", color_range=FULL)
    (frame,) = open_source(encode("a.avi", [stored], codec="amv")).frames()
    np.testing.assert_array_equal(frame.light > 0.3, luma > 100)


# ---------------------------------------------------------------------------------------------------------- damage


def noisy(count: int) -> Iterator[np.ndarray]:
    rng = np.random.default_rng(0)
    for _ in range(count):
        yield rng.integers(0, 256, (64, 96)).astype(np.uint8)


@pytest.mark.parametrize(("name", "codec", "container_options"), [
    ("a.mp4", "libx264", {"movflags": "+faststart"}),
    ("a.mkv", "ffv1", {}),
    ("a.avi", "ffv1", {}),
])  # fmt: skip
def test_a_truncated_file_gives_what_it_has_and_says_so(encode, name: str, codec: str, container_options) -> None:
    path = encode(
        name,
        noisy(40),
        codec=codec,
        container_options=container_options,
        options={"bf": "0"} if codec == "libx264" else {},
    )
    whole = list(open_source(path).frames())
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    source = open_source(path)
    frames = list(source.frames())
    assert 10 < len(frames) < 30
    assert any("truncated" in warning for warning in source.warnings)
    for a, b in zip(frames, whole, strict=False):
        assert a.t_ns == b.t_ns and np.array_equal(a.light, b.light)
    assert len(list(source.frames(5))) == len(frames) - 5


@pytest.mark.parametrize(("name", "codec"), [
    ("a.mkv", "ffv1"), ("a.nut", "ffv1"), ("a.flv", "flv"), ("a.wmv", "wmv2"),
])  # fmt: skip
def test_a_whole_file_that_begins_late_is_not_truncated(encode, name: str, codec: str) -> None:
    stored = [*noisy(13)] if codec == "ffv1" else [chroma_too(code) for code in range(13)]
    path = encode(name, stored, codec=codec, stamps=[90 + k for k in range(13)])
    source = open_source(path)
    assert len(list(source.frames())) == 13 and not source.warnings
    assert source.frames_expected in (12, 13)  # (NUT says when the last one begins)


def test_avi_with_dropped_frames_is_not_truncated(encode) -> None:
    """Their places are in the file, empty, and are counted by its header."""
    stamps = [0, 1, 2, 5, 6, 30, 31, 39]
    path = encode("a.avi", noisy(8), stamps=stamps)
    source = open_source(path)
    assert [round(frame.t_ns * 30e-9, 5) for frame in source.frames()] == stamps
    assert not source.warnings and source.duration_expected_s == pytest.approx(40 / 30)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
    assert any("truncated" in warning for warning in list_warnings(path))


def test_flv_with_reordered_frames_is_not_truncated(encode) -> None:
    """They begin late, by as many frames as are stored before their turn."""
    source = open_source(encode("a.flv", noisy(13), codec="libx264", options={"bf": "3"}))
    assert [next(source.frames()).t_ns > 0, len(list(source.frames())), source.warnings] == [True, 13, []]
    assert source.frames_expected == 13


@pytest.mark.parametrize("container_options", [{}, {"mpegts_m2ts_mode": "1"}], ids=["188", "192"])
def test_a_stream_that_ends_within_a_packet_says_that_it_is_truncated(encode, container_options) -> None:
    """MPEG-TS, which announces nothing; what ends with a packet may be whole."""
    path = encode("a.ts", noisy(40), codec="libx264", container_options=container_options)
    size, data = 192 if container_options else 188, path.read_bytes()
    assert len(data) % size == 0
    for ends, cut in ((len(data), 0), (len(data) // 2 // size * size, 0), (len(data) // 3 // size * size + 100, 100)):
        path.write_bytes(data[:ends])
        source = open_source(path)
        assert 5 < len(list(source.frames())) <= 40
        said = f"truncated: the file has {cut} of the {size} bytes of its last packet"
        assert [text for text in source.warnings if "truncated" in text] == [said] * bool(cut)


@pytest.mark.parametrize(("name", "codec"), [("a.mkv", "ffv1"), ("a.ts", "libx264"), ("a.gif", "gif")])
def test_a_file_that_is_moved_away_meanwhile_is_read_to_its_end(encode, name: str, codec: str) -> None:
    stored = [chroma_too(code).reformat(format="rgb8") for code in range(9)] if codec == "gif" else [*noisy(9)]
    path = encode(name, stored, codec=codec)
    source = open_source(path)
    coming = source.frames()
    next(coming)
    path.rename(path.with_suffix(".elsewhere"))
    assert len(list(coming)) == 8 and not source.warnings


def test_a_gif_that_is_cut_off_says_so(encode) -> None:
    """FFmpeg gives what there is of the last picture, over the one before."""
    stored = [chroma_too(code).reformat(format="rgb8") for code in range(0, 250, 25)]
    path = encode("a.gif", stored, codec="gif")
    whole = path.read_bytes()
    for padding in (b"", bytes(512)):
        path.write_bytes(whole + padding)
        assert len(list(open_source(path).frames())) == 10 and not list_warnings(path)
    for size in (len(whole) - 1, len(whole) * 6 // 10):
        path.write_bytes(whole[:size])
        assert any("truncated" in warning for warning in list_warnings(path))


def test_a_file_without_its_index_is_refused(encode) -> None:
    path = encode("a.mp4", noisy(40), codec="libx264")
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(DataError, match=r"a\.mp4: not a video"):
        open_source(path)


def test_noise_of_an_encrypted_file_is_no_video(encode) -> None:
    """Raw codes decode into pictures whatever they are."""
    key = {"encryption_scheme": "cenc-aes-ctr", "encryption_key": "5c" * 16, "encryption_kid": "a7" * 16}
    frames = [av.VideoFrame.from_ndarray(np.full((24, 32, 3), 20 * k, np.uint8), format="rgb24") for k in range(8)]
    assert len(list(open_source(encode("open.mov", frames, codec="rawvideo")).frames())) == 8
    locked = encode("locked.mov", frames, codec="rawvideo", container_options=key)
    with pytest.raises(DataError, match=r"locked\.mov: no frame .*encrypted packets left out: 8; ffmpeg"):
        open_source(locked)


def test_damage_in_the_middle_costs_only_what_is_damaged(encode) -> None:
    path = encode("a.avi", noisy(20))
    whole = list(open_source(path).frames())
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 3000] = bytes(3000)
    path.write_bytes(data)
    source = open_source(path)
    frames = list(source.frames())
    same = {frame.t_ns for frame in whole for other in frames if np.array_equal(frame.light, other.light)}
    assert 16 <= len(same) <= len(frames) <= 20


def test_damage_that_a_decoder_notices_is_remarked_on(encode) -> None:
    """Most bits of noise may be any; of films it is most damage that is noticed."""
    path = encode("a.mkv", noisy(40), codec="libx264", options={"bf": "0"})
    whole, remarked = path.read_bytes(), 0
    assert not list_warnings(path)
    for seed in range(8):
        draws = np.random.default_rng(seed)
        data, middle = bytearray(whole), int(draws.uniform(0.3, 0.7) * len(whole))
        data[middle : middle + 500] = draws.bytes(500)
        path.write_bytes(data)
        remarked += any("damaged" in warning for warning in list_warnings(path))
    assert remarked >= 1


@pytest.mark.parametrize("options", [{"level": "3", "slices": "4"}, {"level": "3", "slicecrc": "1", "coder": "0"}])
@pytest.mark.parametrize("name", ["a.mkv", "a.avi", "a.nut"])
def test_each_bit_of_damage_in_ffv1_with_checksums_is_remarked_on(encode, name: str, options: dict[str, str]) -> None:
    """By the checksums: the decoder puts the picture before in the place of what is damaged, and says nothing."""
    path = encode(name, noisy(6), options=options)
    assert not list_warnings(path)
    whole = path.read_bytes()
    with av.open(str(path)) as container:
        packets = [bytes(packet) for packet in container.demux(video=0) if packet.size]
    for number, share in ((0, 0.4), (3, 0.0), (3, 0.99), (5, 0.5)):
        data, packet = bytearray(whole), packets[number]
        data[whole.index(packet) + int(share * len(packet))] ^= 16
        path.write_bytes(data)
        said = [warning for warning in list_warnings(path) if "damaged" in warning]
        assert said[0].endswith("guessed with those that build on them: 1") or "left out" in said[0]


def test_ffv1_without_checksums_is_not_taken_for_damaged(encode) -> None:
    for options in ({"level": "1"}, {"level": "3", "slicecrc": "0", "slices": "4"}):
        assert not list_warnings(encode("a.mkv", noisy(6), options=options))


@pytest.mark.parametrize("codec", ["ffv1", "libx264"])
def test_a_matroska_file_that_lacks_its_last_bytes_says_so(encode, codec: str) -> None:
    """However few: the last picture may be among them."""
    path = encode("a.mkv", noisy(20), codec=codec)
    whole = path.read_bytes()
    for cut in (1, 300, len(whole) // 30):
        path.write_bytes(whole[:-cut])
        assert any("truncated" in warning for warning in list_warnings(path))
    path.write_bytes(whole + bytes(100))
    assert not list_warnings(path)


@pytest.mark.parametrize("length", [2**40, 2**56 - 2])
def test_a_matroska_header_longer_than_any_file_is_no_video(tmp_path: Path, length: int) -> None:
    path = tmp_path / "a.mkv"
    path.write_bytes(bytes.fromhex("1a45dfa3") + (1 << 56 | length).to_bytes(8, "big") + bytes(100))
    with pytest.raises(DataError, match="not a video"):
        open_source(path)


@pytest.mark.parametrize("hours", ["9" * 400, "9" * 12, "00"])
def test_a_length_that_no_clip_has_is_not_believed(tmp_path: Path, hours: str) -> None:
    path = tmp_path / "a.nut"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.metadata["DURATION"] = 48, 32, f"{hours}:00:00.2"
        for k, picture in enumerate(flat([10, 20, 30, 40, 50, 60])):
            frame = av.VideoFrame.from_ndarray(picture, format="gray").reformat(format="yuv420p")
            frame.pts = k
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    assert open_source(path).duration_expected_s == pytest.approx(0.2, abs=0.05)


def list_warnings(path: Path) -> list[str]:
    source = open_source(path)
    list(source.frames())
    return source.warnings


def test_a_disk_that_fails_ends_the_clip_with_a_remark(encode, monkeypatch: pytest.MonkeyPatch) -> None:
    path = encode("a.mp4", flat([8 * k for k in range(30)]), codec="libx264", options={"bf": "2"})
    source = open_source(path)
    demux = av.container.InputContainer.demux

    class Failing:
        def __init__(self, container):
            self.container = container

        def demux(self, stream):
            for k, packet in enumerate(demux(self.container, stream)):
                if k == 20:
                    raise av.error.InvalidDataError(1, "disk on fire")
                yield packet

    decoded = footage._decoded
    monkeypatch.setattr(footage, "_decoded", lambda container, *rest: decoded(Failing(container), *rest))
    frames = list(source.frames())
    assert 18 <= len(frames) <= 20  # (the decoder's rest included)
    assert any("cannot be read to its end" in warning for warning in source.warnings)


@pytest.mark.parametrize("name", ["a.mkv", "a.mp4", "a.nut"])
def test_a_title_may_be_of_any_bytes(encode, tmp_path: Path, name: str) -> None:
    """As of programs that write it in the letters of their country."""
    plain, titled, title = encode("plain.mkv", flat([10, 20, 30]), codec="libx264"), tmp_path / name, b"a title of all"
    with av.open(str(plain)) as one, av.open(str(titled), "w") as other:
        other.metadata["title"] = title.decode()
        stream = other.add_stream_from_template(one.streams.video[0])
        for packet in (packet for packet in one.demux(video=0) if packet.size):
            packet.stream = stream
            other.mux(packet)
    content = titled.read_bytes()
    titled.write_bytes(content.replace(title, b"caf\xe9 \xa9 1998..."))
    assert titled.read_bytes() != content and len(list(open_source(titled).frames())) == 3
    if name == "a.mkv":  # (which can be read from a pipe)
        with open(titled, "rb") as file:
            assert len(list(footage.Piped(Kept(file, "a pipe")).pictures([]))) == 3


def test_a_change_of_size_is_refused(encode) -> None:
    small = encode("a.h264", flat([10, 20], (32, 48)), codec="libx264").read_bytes()
    path = encode("b.h264", flat([10, 20], (64, 48)), codec="libx264")
    path.write_bytes(small + path.read_bytes())
    with pytest.raises(DataError, match="size changes to 48x64"):
        list(open_source(path).frames())


def test_interlaced_video_is_remarked_on(encode) -> None:
    path = encode("a.mp4", flat([10, 20]), codec="libx264", options={"x264-params": "tff=1"})
    assert re.fullmatch("interlaced .* -vf bwdif makes a picture of each", open_source(path).warnings[0])


@pytest.mark.parametrize(("aspect", "matrix", "size"), [
    (Fraction(4, 3), (1, 0, 0, 1), "85x48!"),
    (Fraction(8, 9), (1, 0, 0, 1), "64x54!"),
    (Fraction(4, 3), (0, 1, -1, 0), "48x85!"),  # (shown upright)
])  # fmt: skip
def test_pixels_that_are_not_square_are_remarked_on(encode, aspect: Fraction, matrix, size: str) -> None:
    pictures, tags = [np.full((48, 64), 90, np.uint8)] * 2, {"codec": "libx264", "options": {"bf": "0"}}
    path = with_display_matrix(encode("a.mp4", pictures, sample_aspect_ratio=aspect, **tags), matrix)
    assert f"--size {size} straightens it" in open_source(path).warnings[0]
    for nearly in (Fraction(1), Fraction(65, 64)):
        assert not open_source(encode("b.mp4", pictures, sample_aspect_ratio=nearly, **tags)).warnings


@pytest.mark.parametrize("name", ["a.mp4", "a.mkv"])
def test_other_video_streams_than_the_first_are_remarked_on_but_no_covers(tmp_path: Path, name: str) -> None:
    covers = [(1, True)] if name == "a.mp4" else []  # (Matroska has them as attachments)
    for streams, cover in ((1, False), (3, False), *covers):
        path = tmp_path / f"{streams}{cover}{name}"
        with av.open(str(path), "w") as container:
            made = [container.add_stream("mpeg4", rate=25) for _ in range(streams)]
            if cover:
                made.append(container.add_stream("mjpeg", rate=25))
            for stream in made:
                stream.width, stream.height = 48, 32
                stream.pix_fmt = "yuv420p" if stream in made[:streams] else "yuvj420p"
            for stream in made[streams:]:
                stream.disposition = av.stream.Disposition.attached_pic
            for stream in made[::-1]:
                picture = chroma_too(90).reformat(format=stream.pix_fmt)
                picture.pts = 0
                container.mux(stream.encode(picture))
                container.mux(stream.encode(None))
        warnings = open_source(path).warnings
        expected = [f"the first of {streams} video streams is read"] if streams > 1 else []
        assert [warning.split(";")[0] for warning in warnings] == expected


def write_sound(path: Path) -> None:
    with wave.open(str(path), "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(8000)
        sound.writeframes(bytes(8000))


@pytest.mark.parametrize("content", [b"", b"\0" * 100_000, b"just some text, no video\n" * 50, b"RIFF"])
def test_what_is_no_video_is_refused(tmp_path: Path, content: bytes) -> None:
    for name in ("clip.mp4", "clip.txt", "clip"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(DataError, match=name):
            open_source(tmp_path / name)


def test_sound_alone_is_refused(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.wav")
    with pytest.raises(DataError, match="no video stream"):
        open_source(tmp_path / "a.wav")


def test_a_picture_under_another_name_is_refused(tmp_path: Path) -> None:
    import cv2

    (tmp_path / "clip.mp4").write_bytes(cv2.imencode(".png", np.zeros((8, 8), np.uint8))[1].tobytes())
    with pytest.raises(UsageError, match="a single picture"):
        open_source(tmp_path / "clip.mp4")


def test_a_playlist_opens_nothing_else(encode, tmp_path: Path) -> None:
    clip = encode("a.ts", flat([10, 20]), codec="libx264")
    (tmp_path / "list.m3u8").write_text(f"#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/x.ts\n{clip}\n#EXT-X-ENDLIST\n")
    with pytest.raises(DataError):
        open_source(tmp_path / "list.m3u8")


def test_odd_names_are_names(encode, tmp_path: Path) -> None:
    path = encode("a.mkv", flat([10]))
    for name in ("http:clip.mkv", "a b%d.mkv", "pipe:0", "ünïcode.mkv"):
        path.rename(tmp_path / name)
        path = tmp_path / name
        assert len(list(open_source(path).frames())) == 1


@pytest.mark.parametrize("name", ["missing.mp4", "missing/"])
def test_paths_that_cannot_be_meant(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=name.rstrip("/")):
        open_source(tmp_path / name)


def test_options_that_cannot_be_meant(encode) -> None:
    path = encode("a.mkv", flat([10]))
    with pytest.raises(UsageError, match=r"transfer 'sgrb' \(did you mean srgb\?\): expected auto, ") as refused:
        open_source(path, transfer="sgrb")
    assert "bit" not in str(refused.value)
    with pytest.raises(UsageError, match=r"a video says of how many bits"):
        open_source(path, transfer="linear:10bit")
    with pytest.raises(UsageError, match="fps"):
        open_source(path, fps=0)


# ---------------------------------------------------------------------------------------------------------- streaming


def test_frames_do_not_pile_up(encode) -> None:
    path = encode("a.mkv", noisy(60))
    alive: list[weakref.ref] = []
    for frame in open_source(path).frames():
        alive.append(weakref.ref(frame.light))
        del frame
        assert sum(ref() is not None for ref in alive) <= 1


def test_two_readers_do_not_disturb_each_other(encode) -> None:
    source = open_source(encode("a.mkv", noisy(10)))
    for a, b in zip(source.frames(), source.frames(), strict=True):
        assert a.t_ns == b.t_ns and np.array_equal(a.light, b.light) and a.light is not b.light


def test_it_is_ready_for_json(encode) -> None:
    import json

    about = json.loads(json.dumps(open_source(encode("a.mkv", flat([10]))).describe()))
    assert about["kind"] == "video" and about["size"] == [48, 32] and about["codec"] == "ffv1"


def test_a_number_of_frames_that_no_header_has_is_about_right(encode) -> None:
    for name, about in (("a.mkv", "about 3 frames"), ("a.mp4", "video, 48x32, 3 frames")):
        codec = {"codec": "libx264"} if name == "a.mp4" else {}
        source = open_source(encode(name, flat([10, 20, 30]), **codec))
        assert about in source_text(source.describe())
    assert "about 2 frames" in source_text(
        open_source(encode("a.mp4", flat([1, 2, 3]), codec="libx264"), stop=0.04).describe()
    )


# ---------------------------------------------------------------------------------------------------------- real clips


@pytest.mark.parametrize(("name", "size", "count"), [
    ("intel_car-detection.mp4", (768, 432), 377),
    ("intel_asl_book.mkv", (640, 480), 109),
    ("nasa_13013.mp4", (320, 180), 325),
])  # fmt: skip
def test_real_clips_are_read_whole(shared_videos: Path, name: str, size: tuple[int, int], count: int) -> None:
    source = open_source(shared_videos / name)
    assert source.size == size
    with av.open(str(shared_videos / name)) as container:
        stamps = [frame.pts * frame.time_base for frame in container.decode(container.streams.video[0])]
    seen = 0
    for frame, stamp in zip(source.frames(), stamps, strict=True):
        assert abs(frame.t_ns - stamp * 10**9) <= Fraction(1, 2)
        assert frame.light.shape == size[::-1] and np.isfinite(frame.light).all()
        seen += 1
    assert seen == count
    of_two = "the first of 2 video streams is read"  # (nasa_13013 has another one of 480x270)
    assert [said[: len(of_two)] for said in source.warnings] == [of_two] * (name == "nasa_13013.mp4")
