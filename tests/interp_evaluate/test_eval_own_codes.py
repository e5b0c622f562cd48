"""Pictures have the codes of the file that holds them, to those who score them and to those who make more of them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import torch
from skimage.metrics import peak_signal_noise_ratio

from interp.data.layouts import open_sequence
from interp.data.layouts.writing import write_sequence
from interp.data.recorded import clip_of
from interp.evaluate.protocol import Protocol
from interp.evaluate.recordings import Recording
from interp.evaluate.remarks import notes
from interp.evaluate.run import evaluate
from interp.interpolate.whole import interpolate
from interp.own_codes import BRIGHT, codes_of, curve_of, light_of, recoded, shown
from vid2ev import convert, open_source

HEIGHT, WIDTH, FRAMES = 48, 64, 9


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A lossless video of RGB codes, which are of BT.709 as nothing else is said."""
    blobs = cv2.GaussianBlur(np.random.default_rng(1).normal(size=(HEIGHT, WIDTH + 40, 3)), (0, 0), 3)
    codes = np.rint(255 * (blobs - blobs.min()) / np.ptp(blobs)).astype(np.uint8)
    with av.open(str(tmp_path / "film.mkv"), "w") as container:
        stream = container.add_stream("ffv1", rate=240)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "bgr0"
        for k in range(FRAMES):
            shift = np.array([[1, 0, -1.5 * k], [0, 1, 0]], np.float32)
            frame = av.VideoFrame.from_ndarray(cv2.warpAffine(codes, shift, (WIDTH, HEIGHT)), format="bgr24")
            frame.pts, frame.time_base = k, Fraction(1, 240)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return tmp_path / "film.mkv"


def codes_in(film: Path) -> list[np.ndarray]:
    """What FFmpeg takes out of it."""
    with av.open(str(film)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def write(folder: Path, pictures: Sequence[np.ndarray]) -> None:
    folder.mkdir(parents=True)
    for k, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{k:03d}.png"), picture[..., ::-1])


def test_frames_of_a_video_are_scored_by_its_own_codes(film: Path, tmp_path: Path) -> None:
    frames = codes_in(film)
    write(tmp_path / "others" / "film", frames)
    found = evaluate([str(film)], tmp_path / "report", baselines=["nearest"], predictions=[tmp_path / "others"])
    rows = found.rows
    assert not any("RGB of YUV" in note for note in notes(found.summary))
    yuv = found.summary | {"sequences": {"film": found.summary["sequences"]["film"] | {"stored": "yuv420p"}}}
    assert any(note.startswith("others on film: decoders make other RGB of YUV") for note in notes(yuv))
    assert {row.psnr for row in rows if row.method == "others"} == {100.0}
    nearest = [row for row in rows if row.method == "nearest"]
    assert len(nearest) == 7
    for row in nearest:
        key, true = frames[0 if row.position <= 4 else 8], frames[row.position]
        own = peak_signal_noise_ratio(true, key, data_range=int(true.max()) - int(true.min()))
        assert row.position == 4 or row.psnr == pytest.approx(own, abs=1e-9)


def test_pictures_of_a_video_are_its_frames_and_can_be_used_again(film: Path, tmp_path: Path) -> None:
    interpolate(film, tmp_path / "made", multiple=2, method="linear")
    names = sorted((tmp_path / "made").glob("*.png"))
    assert len(names) == 2 * FRAMES - 1
    for frame, name in zip(codes_in(film), names[::2], strict=True):
        np.testing.assert_array_equal(cv2.imread(str(name))[..., ::-1], frame)
    again, first = open_source(tmp_path / "made", colour="rgb"), open_source(film, colour="rgb")
    assert again.describe()["transfer"] == "bt709"
    for one, other in zip([*again.frames()][::2], first.frames(), strict=True):
        np.testing.assert_allclose(one.light, other.light, rtol=1e-6)
    assert convert(tmp_path / "made", tmp_path / "events", preview=False)["counts"]["frames"] == 2 * FRAMES - 1
    assert evaluate([str(tmp_path / "made")], tmp_path / "report", baselines=["linear"]).rows


@pytest.mark.parametrize("kind", ["png", "raw"])
@pytest.mark.parametrize("gammas", [("1.0", "1.0"), ("3.0", '"srgb"')])
def test_frames_of_a_recording_are_of_the_light_of_its_pictures_by_whatever_curve(
    film: Path, tmp_path: Path, gammas: tuple[str, str], kind: str
) -> None:
    """Those that are interpolated, scored, trained with and written for others; of two cameras of two curves, too."""
    rig, made = tmp_path / "rig.toml", tmp_path / "made"
    cameras = [f'"cis"\nset = {{ frame_rate_hz = {60 * 4**k}, gamma = {each} }}' for k, each in enumerate(gammas)]
    named = ((f"c{k}", camera) for k, camera in enumerate([*cameras, '"dvs"']))
    rig.write_text("".join(f'[[camera]]\nname = "{name}"\nsensor = "ideal"\nkind = {each}\n' for name, each in named))
    convert(film, made, rig=rig, pictures=[kind], preview=False, threads=1)
    sequence, exact = open_sequence(made), {"atol": 2e-3, "rtol": 0.05}
    slow, fast = ([frame.light for frame in open_source(made / name / folder, colour="rgb").frames()]
                  for folder in [{"png": "frames", "raw": "raw"}[kind]] for name in ("c0", "c1"))  # fmt: skip
    (group, *_), clip = Recording(sequence, Protocol(3, 3), "made").groups(), clip_of(sequence, 0, 4)
    write_sequence(sequence, tmp_path / "ergb", "hsergb")
    for codes, curve, light in (
        (group.keys[1], group.curve, slow[1]), (group.truth[1], group.curve, fast[2]),
        (clip.keys[1], "srgb", slow[1]), (clip.truth[2], "srgb", fast[2]),
        (open_sequence(tmp_path / "ergb").frame(2), "srgb", fast[2]),
    ):  # fmt: skip
        np.testing.assert_allclose(light_of(curve)[codes], light, **exact)
    interpolate(made, tmp_path / "out", multiple=2, method="linear")
    again = [frame.light for frame in open_source(tmp_path / "out", colour="rgb").frames()]
    np.testing.assert_allclose(again[2], slow[1], **exact)


@pytest.mark.parametrize("curve", ["srgb", "bt709", "smpte240m", "gamma:2.2", "gamma:2.6"])
def test_codes_are_what_they_were(curve: str) -> None:
    codes = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(codes_of(light_of(curve), curve), codes)
    signal = recoded(torch.from_numpy(shown(codes, curve)), curve)
    for rounding in ("round", "truncate"):
        coded = Protocol(7, 7, rounding=rounding).coded(signal.expand(1, 3, 1, -1))
        np.testing.assert_array_equal(coded[0, 0, :, 2], codes)
    assert codes_of(np.array([np.nan, -1.0, 7.0]), curve).tolist() == [0, 0, 255]


def test_light_that_has_no_codes_of_its_own_is_srgb() -> None:
    assert curve_of({"transfer": "bt709"}) == curve_of({"transfer": "bt709", "edits": {"resized": False}}) == "bt709"
    assert curve_of({}) == curve_of({"transfer": "bt709", "edits": {"resized": True}}) == "srgb"
    assert {curve_of({"transfer": curve}) for curve in BRIGHT} == {"srgb"}
