"""The events of a camera while its recording is made: raw columns that only grow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vid2ev.recording.folder import Folder
from vid2ev.stream.events import Events

COLUMNS = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.uint8, "label": np.uint8}


def column_files(within: str = "", labels: bool = False) -> list[str]:
    """The files that a folder is to be made with, for a camera whose files are `within` a part of it."""
    return [f"{within}{name}" for name in COLUMNS if labels or name != "label"]


class EventColumns:
    """The columns of a camera in a folder: `append`, and `blocks` reads all of them again; `count` is how many."""

    def __init__(self, folder: Folder, within: str = "", labels: bool = False):
        self._folder, self._within = folder, within
        self._columns = {name: dtype for name, dtype in COLUMNS.items() if labels or name != "label"}
        self.count = folder.size(f"{within}t") // np.dtype(np.int64).itemsize

    def append(self, events: Events) -> None:
        """Add events; they count from the folder's next checkpoint on."""
        for name, dtype in self._columns.items() if len(events) else ():
            self._folder.write(f"{self._within}{name}", np.ascontiguousarray(getattr(events, name), dtype).data)
        self.count += len(events)

    def blocks(self, block: int) -> Iterator[Events]:
        """All events appended, `block` of them at a time but for the last."""
        files = {name: self._folder.written(f"{self._within}{name}") for name in self._columns}
        for at in range(0, max(self.count, 1), block):
            n = min(block, self.count - at)
            yield Events(
                **{
                    name: np.fromfile(files[name], dtype, n, offset=at * np.dtype(dtype).itemsize)
                    for name, dtype in self._columns.items()
                }
            )
