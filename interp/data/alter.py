"""Clips altered: parts, mirror images, time backwards, grey frames, still parts, sensors that are known less well.

Parts, mirror images and time backwards are exact: the clip of the altered light is the altered clip.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interp.data.chance import Range
from interp.data.clip import Clip
from interp.own_codes import codes_of, light_of
from vid2ev.stream.frames import luminance_of


def cropped(clip: Clip, left: int, top: int, size: tuple[int, int]) -> Clip:
    """A part of `size` (width, height); left, top and size are multiples of `coarser`."""
    width, height = size
    each = clip.coarser
    rows, columns = slice(top, top + height), slice(left, left + width)
    below, beside = slice(top // each, (top + height) // each), slice(left // each, (left + width) // each)
    return replace(
        clip,
        truth=clip.truth[:, rows, columns],
        keys=clip.keys[:, rows, columns],
        off_on=clip.off_on[:, :, below, beside],
    )


def mirrored(clip: Clip) -> Clip:
    """Left and right exchanged."""
    return replace(clip, truth=clip.truth[:, :, ::-1], keys=clip.keys[:, :, ::-1], off_on=clip.off_on[..., ::-1])


def turned(clip: Clip, quarters: int) -> Clip:
    """Turned by quarters of a circle."""
    truth, keys = (np.rot90(frames, quarters, (1, 2)) for frames in (clip.truth, clip.keys))
    return replace(clip, truth=truth, keys=keys, off_on=np.rot90(clip.off_on, quarters, (2, 3)))


def backwards(clip: Clip) -> Clip:
    """With time running backwards: ON for OFF, and the threshold of each for that of the other."""
    return replace(
        clip,
        truth=clip.truth[::-1],
        keys=clip.keys[::-1],
        off_on=clip.off_on[::-1, ::-1],
        contrast=clip.contrast[::-1],
    )


def grey(clip: Clip) -> Clip:
    """With frames of one colour, as a grey camera would have taken them: of the luminance of their light."""
    return replace(clip, truth=_grey(clip.truth), keys=_grey(clip.keys))


def stilled(clip: Clip, still: np.ndarray, quality: int | None = None) -> Clip:
    """Nothing happens where `still` [H, W, bool]: what the first key instant shows stays, and there are no events.

    quality   of a JPEG that the still part went through, as in films; None for none.  Light beyond codes stays as it is
    """
    truth, keys, off_on = (np.array(each) for each in (clip.truth, clip.keys, clip.off_on))
    first = truth[0] if quality is None or truth.dtype != np.uint8 else _coded(truth[0], quality)
    noise = keys.astype(np.int16) - truth[[0, -1]] if truth.dtype == np.uint8 else None
    np.copyto(truth, first, where=still[..., None])
    if noise is None:
        keys[1, still] = keys[0, still]
    else:  # (the noise of both key frames stays as it was where they saw an instant; blur goes)
        small = np.abs(noise).max(axis=(0, 3)) < BLURRED
        for key, own in zip(keys, noise, strict=True):
            key[still] = np.clip(first.astype(np.int16) + own * small[..., None], 0, 255).astype(np.uint8)[still]
    each = clip.coarser
    np.copyto(off_on, 0, where=still[each // 2 :: each, each // 2 :: each])
    return replace(clip, truth=truth, keys=keys, off_on=off_on)


def thinned(clip: Clip, draw: np.random.Generator, share: float) -> Clip:
    """With a share of the events lost, and of what they stand for."""
    off_on = np.array(clip.off_on, np.float16)
    some = off_on > 0  # (of the others nothing is drawn, but it takes as long)
    most = np.ceil(off_on[some])
    off_on[some] *= draw.binomial(most.astype(np.int64), 1 - share) / most
    return replace(clip, off_on=off_on)


def misjudged(clip: Clip, draw: np.random.Generator, error: Range) -> Clip:
    """With thresholds believed to be some factor of what they are, OFF and ON apart."""
    off, on = (value * float(draw.uniform(*error)) for value in clip.contrast)
    return replace(clip, contrast=(off, on))


def _grey(frames: np.ndarray) -> np.ndarray:
    """Frames [N, H, W, 3] as [N, H, W, 1], codes or light as they were."""
    if frames.dtype == np.uint8:
        return codes_of(luminance_of(light_of("srgb")[frames]), "srgb")[..., None]
    return luminance_of(frames.astype(np.float32)).astype(frames.dtype)[..., None]


BLURRED = 24  # codes: what key frames differ by from an instant is blur and no noise


def _coded(codes: np.ndarray, quality: int) -> np.ndarray:
    """Codes [H, W, 3] after a JPEG."""
    import cv2

    coded = cv2.imencode(".jpg", np.ascontiguousarray(codes[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    decoded = cv2.imdecode(coded, cv2.IMREAD_COLOR)
    assert decoded is not None  # (it was coded just now)
    return decoded[..., ::-1]
