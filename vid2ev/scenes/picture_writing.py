"""Pictures of scenes as files, which `vid2ev convert` reads again.

png     8 bits, sRGB: for people; light above 1.0 is lost
png16   16 bits, sRGB: for events, too; light above 1.0 is lost
tiff    float32, linear, all light
exr     float32, linear, all light; needs the package OpenEXR
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.light.exr_writing import write_exr
from vid2ev.light.transfer import parse_transfer
from vid2ev.untrusted import openexr

Writer = Callable[[np.ndarray, Path], None]


def writer_of(kind: str) -> tuple[Writer, str]:
    """What writes light [H, W, 3] to a path, and the suffix of the file.  Raises UsageError."""
    if kind not in WRITERS:
        raise UsageError(f"frames '{kind}': expected one of {', '.join(WRITERS)}")
    if kind == "exr":
        openexr("frames 'exr'")
    return WRITERS[kind], {"png16": ".png"}.get(kind, f".{kind}")


def _write_png(light: np.ndarray, path: Path) -> None:
    from vid2ev.light.eight_bits import srgb_codes

    _write(srgb_codes(light), path)


def _write_png16(light: np.ndarray, path: Path) -> None:
    signal = parse_transfer("srgb").to_signal(np.clip(light, 0, 1))
    _write(np.rint(65535 * signal).astype(np.uint16), path)


def _write_tiff(light: np.ndarray, path: Path) -> None:
    _write(np.asarray(light, np.float32), path)


def _write_exr(light: np.ndarray, path: Path) -> None:
    write_exr(path, {name: light[..., k] for k, name in enumerate("RGB")})


def _write(codes: np.ndarray, path: Path) -> None:
    import cv2

    quick = [cv2.IMWRITE_PNG_COMPRESSION, 2] if path.suffix == ".png" else []
    path.write_bytes(cv2.imencode(path.suffix, codes[..., ::-1], quick)[1].tobytes())  # (imwrite does not say why not)


WRITERS: dict[str, Writer] = {"png": _write_png, "png16": _write_png16, "tiff": _write_tiff, "exr": _write_exr}
