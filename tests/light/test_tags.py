"""What the tags of a video mean where they are missing, or say more than the format of its pixels."""

from __future__ import annotations

import pytest

from vid2ev.errors import DataError
from vid2ev.light.tags import MATRICES, UNSPECIFIED, is_full_range, matrix_of, tag_of, transfer_of


@pytest.mark.parametrize("tag", [0, 2])
@pytest.mark.parametrize(
    ("size", "meant"),
    [((640, 480), 6), ((720, 576), 6), ((1280, 544), 1), ((960, 720), 1), ((720, 578), 1), ((1279, 576), 6)],
)
def test_untagged_video_is_of_its_size(tag: int, size: tuple[int, int], meant: int) -> None:
    """Larger than television's standard definition, be it only in one direction: BT.709; else BT.601."""
    assert matrix_of(tag, *size, "a.mp4") == MATRICES[meant]


@pytest.mark.parametrize("tag", MATRICES)
def test_a_tag_counts_whatever_the_size(tag: int) -> None:
    assert matrix_of(tag, 640, 480, "a.mp4") == matrix_of(tag, 1920, 1080, "a.mp4") == MATRICES[tag]
    assert matrix_of(8, 640, 480, "a.mp4") is None
    with pytest.raises(DataError, match="matrix 14"):
        matrix_of(14, 640, 480, "a.mp4")


@pytest.mark.parametrize("pixels", ["yuv420p", "yuvj420p", "gray", "gray10le", "gbrp"])
def test_the_flag_of_the_range_counts_and_without_it_the_format(pixels: str) -> None:
    unspecified, limited, full = (is_full_range(tag, pixels) for tag in (0, 1, 2))
    assert (unspecified, limited, full) == (pixels != "yuv420p", False, True)


def test_a_transfer_that_is_asked_for_counts_and_then_the_tag() -> None:
    assert [transfer_of(16, asked) for asked in ("auto", "srgb")] == ["pq", "srgb"]
    assert all(transfer_of(tag_of(curve), "auto") == curve for curve in ("bt709", "srgb", "gamma:2.2", "pq"))
    assert tag_of("gamma:1.7") == UNSPECIFIED and transfer_of(UNSPECIFIED, "auto") == "bt709"
    assert transfer_of(2, "auto") == transfer_of(2, "auto", "h264") == "bt709"
    assert [transfer_of(tag, "auto", "apng") for tag in (2, 16)] == ["srgb", "pq"]
