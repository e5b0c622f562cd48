"""Films: codes are those of BT.709, a single coloured pixel keeps its colour, the same bytes each time."""

from __future__ import annotations

import os
from pathlib import Path

import av
import numpy as np
import pytest

from vid2ev.pictures.colours import GROUND, MOST, NEUTRAL, OFF, ON, codes, event_colours, in_8_bits
from vid2ev.pictures.film import Film, join_films, planes, write_film


def split(coded: np.ndarray, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    chroma = coded[height:].reshape(2, height // 2, -1)
    return coded[:height], chroma[0], chroma[1]


@pytest.mark.parametrize("colour", [ON, OFF, GROUND, (1, 1, 1), (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
def test_plain_colours_have_the_codes_of_bt709(colour: np.ndarray) -> None:
    exact = in_8_bits(np.array(colour, float))
    for plane, code in zip(split(planes(np.full((4, 6, 3), exact)), 4), codes(exact / 255), strict=True):
        assert (plane == code).all()


def test_the_codes_are_those_of_the_recommendation() -> None:
    # 8-bit codes of the 75 % colour bars by BT.709: white, yellow, cyan, green, magenta, red, blue
    bars = 0.75 * np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [0, 1, 0], [1, 0, 1], [1, 0, 0], [0, 0, 1]])
    assert codes(bars).tolist() == [
        [180, 128, 128], [168, 44, 136], [145, 147, 44], [133, 63, 52], [63, 193, 204], [51, 109, 212], [28, 212, 120]
    ]  # fmt: skip


def test_a_single_event_keeps_its_colour_on_dark_ground() -> None:
    for colour in (ON, OFF):
        picture = np.full((2, 2, 3), in_8_bits(GROUND))
        picture[1, 0] = in_8_bits(colour)
        luma, u, v = split(planes(picture), 2)
        _, *full = codes(colour)
        assert luma[1, 0] == codes(colour)[0] and luma[0, 0] == codes(GROUND)[0]
        shares = [
            (int(plane[0, 0]) - NEUTRAL) / (int(code) - NEUTRAL) for plane, code in zip((u, v), full, strict=True)
        ]
        assert min(shares) > 0.8  # a plain mean would have a quarter


def test_gray_has_no_colour() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (8, 8, 1)).astype(np.uint8).repeat(3, axis=2)
    luma, u, v = split(planes(picture), 8)
    assert (u == NEUTRAL).all() and (v == NEUTRAL).all()
    np.testing.assert_allclose(luma, 16 + 219 / 255 * picture[..., 0], atol=0.51)


def test_a_decoder_shows_what_was_drawn_and_the_same_bytes_come_again(tmp_path: Path) -> None:
    colours = in_8_bits(event_colours()).reshape(-1, 3)
    picture = colours[: (MOST + 1) ** 2].reshape(16, 16, 3).repeat(8, axis=0).repeat(8, axis=1)
    for name in ("one.mp4", "other.mp4"):
        with Film(tmp_path / name, (128, 128), 30) as film:
            for k in range(20):
                film.add(np.roll(picture, 8 * k, axis=1))
        assert film.frames == 20
    assert (tmp_path / "one.mp4").read_bytes() == (tmp_path / "other.mp4").read_bytes()
    with av.open(str(tmp_path / "one.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 20
    for k, frame in enumerate(frames):
        assert np.abs(frame.astype(int) - np.roll(picture, 8 * k, axis=1)).mean() < 4


@pytest.mark.parametrize("name", ["12:00.mp4", "http:film.mp4", "pipe:1", os.fsdecode(b"\xff.mp4"), "100%d.mp4"])
def test_films_are_made_and_joined_whatever_they_are_called(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    picture, films = np.zeros((16, 16, 3), np.uint8), [Path("film.mp4"), Path(name)]
    for path in films:
        write_film(path, [picture] * 3, 30)
        join_films(Path(f"{path}.joined"), [(path, 0), (path, 3)], 30)
    assert films[0].read_bytes() == films[1].read_bytes()
    assert Path("film.mp4.joined").read_bytes() == Path(f"{name}.joined").read_bytes()


def test_a_film_that_cannot_be_written_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError), Film(tmp_path / "no" / "film.mp4", (16, 16), 30) as film:
        film.add(np.zeros((16, 16, 3), np.uint8))
