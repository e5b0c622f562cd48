"""Files that vid2ev does not write, made of their bytes as their authors describe them."""

from __future__ import annotations

import numpy as np

from vid2ev.stream.events import Events

AEDAT2_HEAD = "#!AER-DAT2.0\r\n# This is a raw AE data file - do not edit\r\n# Timestamps tick is 1 us\r\n"


def es(events: Events, size: tuple[int, int], kind: int = 1) -> bytes:
    """Event Stream 2, DVS or ATIS."""
    content = bytearray(b"Event Stream" + bytes([2, 0, 0, kind]) + np.array(size, "<u2").tobytes())
    most, now = (127, 0) if kind == 1 else (63, 0)
    for t, x, y, p in zip(events.t.tolist(), events.x.tolist(), events.y.tolist(), events.p.tolist(), strict=True):
        passed, now = t - now, t
        if kind == 2:  # (up to three at a time)
            content += b"\xff" * (passed // (3 * most)) + bytes([0xFC + passed % (3 * most) // most])
        else:
            content += b"\xff" * (passed // most) + b"\xfe"  # (which says nothing of time)
        content.append((passed % most) << (kind) | p << (kind - 1))
        content += np.array([x, size[1] - 1 - y], "<u2").tobytes()
    return bytes(content)


def aedat2(address: np.ndarray, t: np.ndarray, chip: str = "") -> bytes:
    """jAER's AEDAT 2.0, perhaps with the line that names the camera."""
    line = f"# AEChip: {chip}\r\n" if chip else ""
    return (AEDAT2_HEAD + line).encode() + np.stack([address, t], axis=1).astype(">u4").tobytes()


def davis_address(events: Events, size: tuple[int, int]) -> np.ndarray:
    """Where a DAVIS says that they are."""
    x, y = size[0] - 1 - events.x.astype(np.int64), size[1] - 1 - events.y.astype(np.int64)
    return y << 22 | x << 12 | events.p.astype(np.int64) << 11


def dvs128_address(events: Events) -> np.ndarray:
    """Where a DVS128 says that they are."""
    x, y = 127 - events.x.astype(np.int64), 127 - events.y.astype(np.int64)
    return y << 8 | x << 1 | (1 - events.p.astype(np.int64))


def dvs640_address(events: Events) -> np.ndarray:
    """Where v2e says that they are, of its 640x480."""
    x, y = 639 - events.x.astype(np.int64), 479 - events.y.astype(np.int64)
    return y << 11 | x << 1 | events.p.astype(np.int64)


def nmnist(events: Events) -> bytes:
    """40 bits for each event."""
    word = events.x.astype(np.uint64) << 32 | events.y.astype(np.uint64) << 24 | events.p.astype(np.uint64) << 23
    return (word | events.t.astype(np.uint64)).astype(">u8").view(np.uint8).reshape(-1, 8)[:, 3:].tobytes()
