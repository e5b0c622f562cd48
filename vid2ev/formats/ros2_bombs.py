"""Bags of ROS 2 that were made to fill memory or disk: refused before rosbags takes them at their word.

rosbags unpacks what a bag says is compressed, however large it becomes, and reads metadata.yaml however deep it is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from vid2ev.errors import DataError
from vid2ev.untrusted import check_bytes, check_depth, check_file, read_text

PART = 1 << 20  # bytes unpacked at a time
LIKELY = 100  # times smaller than what is in them files of events never are


def check_bag(metadata: Path) -> None:
    """Raise DataError for the bag of a metadata.yaml that would take forever to read, or fill the disk."""
    try:
        text = read_text(metadata)
    except UnicodeDecodeError as error:
        raise DataError(f"{metadata} is no UTF-8 text; get another copy") from error
    check_depth(metadata, text)
    for part in metadata.parent.iterdir():
        check_file(part)
    for packed in metadata.parent.glob("*.zstd"):  # (those are unpacked to a temporary folder, as a whole)
        _check_packed(packed)


def _check_packed(path: Path) -> None:
    """Raise DataError for a file that becomes suspiciously large."""
    from backports import zstd

    stored, size = path.stat().st_size, 0
    with zstd.open(path, "rb") as file:
        while part := file.read(PART):
            size += len(part)
            if size > LIKELY * stored:
                check_bytes(path, size, "what is packed in it")


@cache
def bound_decompression() -> None:
    """Have rosbags unpack no more than may be."""
    from rosbags.rosbag2 import reader, storage_mcap

    storage_mcap.DECOMPRESSORS["lz4"] = lambda content, size: _unpacked(_lz4, content, size)
    storage_mcap.DECOMPRESSORS["zstd"] = lambda content, size: _unpacked(_zstd, content, size)
    reader.zstd = _Bound  # type: ignore[assignment]


def _unpacked(new: Callable[[], Any], content: bytes, size: int | None) -> bytes:
    """The content of a chunk, which says how large it is, or of a message; no more than that."""
    decompressor, parts, found = new(), list[bytes](), 0
    while not decompressor.eof:
        parts.append(decompressor.decompress(b"" if parts else content, PART))
        found += len(parts[-1])
        if size is not None and found > size:
            raise ValueError("a chunk is larger than it says")
        check_bytes("a message", found)
        if decompressor.needs_input:
            break
    return b"".join(parts)


def _lz4() -> Any:
    import lz4.frame

    return lz4.frame.LZ4FrameDecompressor()


def _zstd() -> Any:
    from backports import zstd

    return zstd.ZstdDecompressor()


class _Bound:
    """The module zstd as rosbags uses it."""

    @staticmethod
    def open(*arguments: Any) -> Any:
        """A file, unpacked."""
        from backports import zstd

        return zstd.open(*arguments)

    @staticmethod
    def decompress(content: bytes) -> bytes:
        """A message, unpacked."""
        return _unpacked(_zstd, content, None)
