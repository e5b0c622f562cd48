"""MPEG-TS and GIF: where a file was cut off, by its last bytes.

MPEG-TS says nowhere how long it is, and has no end: what ends with a packet may be whole.  All packets are of one size
and begin with one byte, so what ends within a packet is not.  GIF ends with a byte of its own, and of a picture that is
cut off FFmpeg gives what there is, over the picture before.

Sources: ITU-T H.222.0 | ISO/IEC 13818-1, 2.4.3.2; 192 bytes, with a time before each packet, are those of Blu-ray.
GIF89a specification (CompuServe, 1990), section 27.
"""

from __future__ import annotations

TAIL = 1 << 12  # bytes at the end that say it
SYNC = 0x47
FIRST_BYTE = {188: 0, 192: 4, 204: 0}  # of a packet of so many bytes: where it is
ENOUGH = 5  # packets in a row are no chance
GIF_TRAILER = b"\x3b"


def cut_packet(tail: bytes) -> tuple[int, int] | None:
    """How many bytes of its last packet a stream has, and of how many; None if that is whole, or where nothing in its
    last `TAIL` bytes looks like packets."""
    for size, first in FIRST_BYTE.items():
        for there in range(size):
            begins = tail[len(tail) - there - size + first :: -size]
            if len(begins) >= ENOUGH and set(begins) == {SYNC}:
                return (there, size) if there else None
    return None


def remarks_on_end(container: str, tail: bytes) -> list[str]:
    """That a file in a container of this name (FFmpeg's) was cut off, if that can be seen of its end."""
    if container == "gif" and tail and not tail.rstrip(b"\0").endswith(GIF_TRAILER):  # (what pads a file is zeros)
        return ["truncated: the file does not end as a GIF does, so its last picture may be one in part"]
    cut = cut_packet(tail) if container == "mpegts" else None
    return [f"truncated: the file has {cut[0]} of the {cut[1]} bytes of its last packet"] if cut else []
