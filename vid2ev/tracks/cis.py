"""The track of a frame camera: its exposures, each on the disk as soon as it is read out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vid2ev.pictures.film import remarks_on_size
from vid2ev.recording.exposures import KINDS, ExposureFiles
from vid2ev.recording.folder import Folder
from vid2ev.sensors.cis import Cis
from vid2ev.stream.frames import Frame
from vid2ev.terminal import counted
from vid2ev.tracks import NEVER_US
from vid2ev.tracks.outputs import Outputs


class CisTrack:
    """A frame camera whose files are `within` a folder."""

    events = 0

    def __init__(self, cis: Cis, folder: Folder, outputs: Outputs, *, within: str = ""):
        self.cis = cis
        self.last_us = NEVER_US
        self._begun = False
        spec = cis.spec
        self._files = ExposureFiles(
            folder.partial / within, outputs.pictures, spec.picture_codes(), spec.curve, spec.frame_rate_hz
        )

    def begin(self, frame: Frame) -> None:
        """The first frame; after `restore`, the last source frame before the checkpoint, which the sensor has seen."""
        if not self._begun:
            self._files.keep(0)
            self.add(frame)

    def add(self, frame: Frame) -> None:
        """The next frame, and the exposures that it completes."""
        self._begun = True
        for exposure in self.cis.exposures(frame):
            self._files.add(exposure)
            self.last_us = exposure.end_ns // 1000

    def finish(self) -> None:
        """Exposures that the light did not last for are dropped."""
        self.cis.flush()

    def close(self) -> None:
        """Bring the pictures to the disk."""
        self._files.sync()

    def state(self) -> dict[str, np.ndarray]:
        """Sensor, and how many pictures there are."""
        state = {f"cis.{name}": array for name, array in self.cis.state().items()}
        return state | {"pictures": np.array([self._files.count, self.last_us], np.int64)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state."""
        self._begun = True
        self.cis.restore({key[4:]: array for key, array in state.items() if key.startswith("cis.")})
        count, self.last_us = (int(value) for value in state["pictures"])
        self._files.keep(count)

    def write(self, whole: Path, start_us: int, duration_us: int) -> None:
        """The pictures, and the film of them."""
        self._files.finish(whole)

    def counts(self) -> dict[str, int]:
        """Exposures made and not made."""
        counts = self.cis.counts
        return {"exposures": counts.pop("frames")} | counts

    def remarks(self) -> list[str]:
        """What is missing or was mended."""
        counts, remarks = self.cis.counts, []
        if not counts["frames"]:
            remarks.append("the light is shorter than an exposure: there are no frames")
        if counts["not_finite"]:
            remarks.append(
                f"{counted(counts['not_finite'], 'value')} of light not finite, beyond 1e30, or negative where"
                " colours cannot be; taken for 0 or 1e30"
            )
        if "mp4" in self._files.kinds and counts["frames"]:
            remarks += remarks_on_size(KINDS["mp4"], self.cis.size)
        return remarks
