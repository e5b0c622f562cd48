"""FFV1: whether a packet is as it was written, by the checksums of its slices.

FFmpeg's decoder puts the picture before in the place of a slice whose checksum is wrong, and tells nobody but its log.

    packet   slices, one behind the other
    slice    data, uint24 bytes of data, uint8 status, uint32 checksum: the CRC of all of the slice, this too, is 0

Source: RFC 9043, sections 4.5 and 4.9 (versions 3 on; without `ec` a slice has neither status nor checksum).
"""

from __future__ import annotations

import zlib

FOOTER = 8  # bytes
_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_ONES = 0xFFFFFFFF


def is_sound(packet: bytes) -> bool:
    """Whether all of a packet is slices with a checksum that is right; of a file without checksums no packet is."""
    end = len(packet)
    while end >= FOOTER:
        begin = end - FOOTER - int.from_bytes(packet[end - FOOTER : end - 5], "big")
        if begin < 0 or _crc(packet[begin:end]):
            return False
        end = begin
    return not end and bool(packet)


def _crc(data: bytes) -> int:
    """CRC-32 that begins with 0 and takes the high bit of each byte first; mirrored, as zlib takes the low bit."""
    return zlib.crc32(data.translate(_MIRRORED), _ONES) ^ _ONES
