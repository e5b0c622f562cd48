"""Codes of pictures by the curve of their source.

Methods take and give sRGB; pictures are written and scored by the codes of the files that hold them: what FFmpeg takes
out of a video of BT.709 are codes of that curve.  Light that was resized has no codes yet, and that of curves for more
light than 8 bits hold has none that people could look at: these are sRGB.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import torch

from interp.light import to_light
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.light.tags import TRANSFERS
from vid2ev.light.transfer import parse_transfer

BRIGHT = ("pq", "hlg", "log100", "log316", "st428", "linear")  # curves of more light than white


def curve_of(about: dict[str, Any]) -> str:
    """The transfer curve of the codes that pictures of a source have, of which `Source.describe` says so much."""
    said, resized = str(about.get("transfer", "srgb")), about.get("edits", {}).get("resized", False)
    return "srgb" if resized or said in BRIGHT else said


def curve_of_film(said: str) -> str:
    """That of a film that looks as its source does: the source's, where films can say that it is theirs."""
    return said if said in TRANSFERS.values() and said not in BRIGHT else "bt709"


def codes_of(light: np.ndarray, curve: str) -> np.ndarray:
    """Codes [uint8] of light of any shape; white is 1.0 and above, NaN is black."""
    if curve == "srgb":
        return srgb_codes(light)
    return np.searchsorted(_halves(curve), np.nan_to_num(light, nan=0.0), side="right").astype(np.uint8)


def shown(codes: np.ndarray, curve: str) -> np.ndarray:
    """sRGB [float32, 0 to 1] of codes [uint8]."""
    return _shown(curve)[codes]


def in_srgb(codes: np.ndarray, curve: str) -> np.ndarray:
    """The sRGB codes [uint8] nearest to codes of a curve."""
    return codes if curve == "srgb" else codes_of(light_of(curve), "srgb")[codes]


def recoded(images: torch.Tensor, curve: str) -> torch.Tensor:
    """The signal [float32, 0 to 1] by a curve of images in sRGB."""
    if curve == "srgb":
        return images
    light = to_light(images.float().clamp(0, 1), "srgb").cpu().numpy()
    return torch.from_numpy(parse_transfer(curve).to_signal(light).astype(np.float32))


@lru_cache(8)
def light_of(curve: str) -> np.ndarray:
    """Light [float32, 256] of each code."""
    return parse_transfer(curve).to_light(np.arange(256) / 255).astype(np.float32)


@lru_cache(8)
def _halves(curve: str) -> np.ndarray:
    """The light from which on it is the next code [float32, 255]."""
    return parse_transfer(curve).to_light((np.arange(255) + 0.5) / 255).astype(np.float32)


@lru_cache(8)
def _shown(curve: str) -> np.ndarray:
    if curve == "srgb":
        return np.arange(256, dtype=np.float32) / np.float32(255)
    return parse_transfer("srgb").to_signal(parse_transfer(curve).to_light(np.arange(256) / 255)).astype(np.float32)
