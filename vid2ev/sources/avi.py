"""Times in AVI files, which have none of presentation: the stamp of a packet is its place, in the order of decoding.

FFmpeg gives pictures of H.264 with B-frames, which come in order of presentation, the stamps of their packets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from heapq import heappop, heappush
from typing import Any

FARTHEST = 16  # pictures by which a packet may precede its place (H.264, Annex A: max_num_reorder_frames)


def stamps_in_order(pictures: Iterator[Any]) -> Iterator[Any]:
    """Pictures in order of presentation, with the stamps that they have between them in that order, too."""
    waiting: deque[Any] = deque()
    stamps: list[int] = []
    for picture in pictures:
        waiting.append(picture)
        if picture.pts is not None:
            heappush(stamps, picture.pts)
        if len(waiting) > FARTHEST:
            yield _stamped(waiting.popleft(), stamps)
    while waiting:
        yield _stamped(waiting.popleft(), stamps)


def _stamped(picture: Any, stamps: list[int]) -> Any:
    """The picture with the first of the stamps, if it has one at all."""
    if picture.pts is not None:
        picture.pts = heappop(stamps)
    return picture
