"""The track of an event camera: events, the preview, the instants of the frames, probed pixels."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import dropwhile, takewhile
from pathlib import Path

import numpy as np

from vid2ev.formats.event_file import BLOCK, Picture, Recording
from vid2ev.physics.fixed_rate import latest_us
from vid2ev.pictures.film import remarks_on_size
from vid2ev.recording.columns import EventColumns, column_files
from vid2ev.recording.disk import write_npz
from vid2ev.recording.folder import Folder
from vid2ev.recording.preview import Preview
from vid2ev.recording.probe import HEADER, Probe, plot
from vid2ev.sensors.dvs import Dvs
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.terminal import counted
from vid2ev.tracks import NEVER_US
from vid2ev.tracks.outputs import Outputs
from vid2ev.views.on_disk import KINDS

FRAME_US, PROBE = "frame_us", "probe.csv"  # files that grow beside the events


def dvs_files(within: str, labels: bool, outputs: Outputs) -> list[str]:
    """The files that grow, `within` the folder."""
    return [*column_files(within, labels), f"{within}{FRAME_US}", *[f"{within}{PROBE}"] * bool(outputs.probe)]


class DvsTrack:
    """An event camera whose files are `within` a folder.

    rate      pictures per second of the preview
    pictures  gives the frames to be kept in files of events that have room for them; None for none
    probed    gives the lines of probe.csv, where pixels were probed before
    """

    def __init__(
        self,
        dvs: Dvs,
        folder: Folder,
        outputs: Outputs,
        *,
        within: str = "",
        rate: int = 30,
        pictures: Callable[[], Iterator[Picture]] | None = None,
        probed: Callable[[], Iterator[bytes]] | None = None,
    ):
        self.dvs, self.folder, self.outputs = dvs, folder, outputs
        self.last_us = NEVER_US
        self._within, self._pictures, self._probed = within, pictures, probed
        self._columns = EventColumns(folder, within, dvs.labels)
        self._film = Preview(dvs.size, folder.partial / within, wanted=outputs.preview, rate=rate)
        pixels = () if probed else tuple(filter(dvs.simulates, outputs.probe))
        self._probe = self._probe_of(pixels) if pixels else None
        self._waiting: list[Frame] = []  # until there are as many as the sensor takes at a time

    @property
    def events(self) -> int:
        """Events so far, of the frames that the sensor has seen."""
        return self._columns.count

    def begin(self, frame: Frame) -> None:
        """The first frame; after `restore`, the last source frame before the checkpoint."""
        with self.folder.taking_up():
            self._film.begin(frame)
        if not self.folder.size(f"{self._within}{FRAME_US}"):
            self.dvs.see(frame)
            self._note(frame)
            if self._probe:
                self.folder.write(f"{self._within}{PROBE}", HEADER)
                self._look_inside(frame, Events.empty(), None)

    def add(self, frame: Frame) -> None:
        """The next frame, and its events, now or with those of the next few."""
        self._waiting.append(frame)
        if self._probe or len(self._waiting) >= self.dvs.at_once:
            self._see()

    def finish(self) -> None:
        """What the sensor held back."""
        self._see()
        events = self.dvs.flush()
        self._append(events)
        self._film.finish(events)
        if self._probe:
            self.folder.write(f"{self._within}{PROBE}", "".join(self._probe.event_lines(events)).encode())

    def close(self) -> None:
        """Let the sensor see all frames, and end a piece of the preview."""
        self._see()
        self._film.close()

    def state(self) -> dict[str, np.ndarray]:
        """Sensor, preview, and the last event."""
        state = {f"dvs.{name}": array for name, array in self.dvs.state().items()}
        state |= {f"film.{name}": array for name, array in self._film.state().items()}
        return state | {"last_us": np.array(self.last_us, np.int64)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state."""
        for part, name in ((self.dvs, "dvs."), (self._film, "film.")):
            part.restore({key.removeprefix(name): array for key, array in state.items() if key.startswith(name)})
        self.last_us = int(state["last_us"])

    def write(self, whole: Path, start_us: int, duration_us: int) -> None:
        """The files of the recording."""
        self.outputs.write(whole, self._recording(start_us, duration_us))
        with self.folder.taking_up():
            self._film.join(whole / "preview.mp4", duration_us)
        if self._probe:
            shutil.copyfile(self.folder.written(f"{self._within}{PROBE}"), whole / PROBE)
        elif self._probed and self.outputs.probe:
            with open(whole / PROBE, "wb") as file:
                file.writelines(self._probed())
        if (whole / PROBE).exists():
            plot(whole / PROBE, whole / "probe.png")
        if self.outputs.noise_maps:
            write_npz(whole / "noise_maps.npz", self.dvs.maps())

    def counts(self) -> dict[str, int]:
        """Events, and what became of crossings."""
        return {"events": self.events} | self.dvs.counts

    def remarks(self) -> list[str]:
        """What is missing or was mended."""
        counts, remarks = self.dvs.counts, []
        if counts["capped"]:
            remarks.append(
                f"{counted(counts['capped'], 'time')} a pixel had more than max_crossings ="
                f" {self.dvs.spec.max_crossings} crossings from frame to frame; the rest is missing"
            )
        if counts["not_finite"]:
            remarks.append(
                f"{counted(counts['not_finite'], 'value')} of light negative, not finite or beyond 1e30; taken for"
                " 0 or 1e30"
            )
        for key, (on, off) in self.dvs.spec.reached_spreads().items():
            remarks.append(
                f"{key} = {getattr(self.dvs.spec, key):g} nat is more than the thresholds have room for; their spread"
                f" is {on:.3g} nat (ON) and {off:.3g} nat (OFF)"
            )
        if self._pictures is None and (kinds := [kind.name for kind in self.outputs.kinds() if "frames" in kind.keeps]):
            remarks.append(f"{', '.join(kinds)}: without the frames beside the events, as the source passes once")
        if self.outputs.frames == "mp4":
            remarks += remarks_on_size(KINDS["mp4"], self.dvs.size)
        return remarks

    def _see(self) -> None:
        """Show the sensor the frames that wait, and keep their events."""
        frames, self._waiting = self._waiting, []
        before = self.dvs.inside(self._probe.places) if self._probe and frames else None  # (of one frame at a time)
        for frame, events in zip(frames, self.dvs.see_all(frames), strict=True):
            self._append(events)
            self._film.add(frame, events)
            self._note(frame)
            self._look_inside(frame, events, before)

    def _append(self, events: Events) -> None:
        self._columns.append(events)
        self.last_us = int(events.t[-1]) if len(events) else self.last_us

    def _note(self, frame: Frame) -> None:
        if frame.original:
            self.folder.write(f"{self._within}{FRAME_US}", np.int64(frame.t_ns // 1000).tobytes())

    def _probe_of(self, pixels: Sequence[tuple[int, int]]) -> Probe:
        if self.dvs.spec.delay_us > 0 or latest_us(self.dvs.spec) > 0:  # an event may be told of after the next frame
            return Probe(pixels, self.dvs.size[0])
        maps = self.dvs.maps()
        return Probe(pixels, self.dvs.size[0], (maps["threshold_on"], maps["threshold_off"]))

    def _look_inside(self, frame: Frame, events: Events, before: Sequence[np.ndarray] | None) -> None:
        if self._probe:
            lines = self._probe.lines(frame, events, self.dvs.inside(self._probe.places), before)
            self.folder.write(f"{self._within}{PROBE}", lines)

    def _recording(self, start_us: int, duration_us: int) -> Recording:
        """What event files are written from.  Raises DataError for times that a damaged checkpoint has made up: where
        nothing happens, some formats write on and on."""
        frame_us = np.fromfile(self.folder.written(f"{self._within}{FRAME_US}"), np.int64)
        with self.folder.taking_up():
            # (an event is at least a microsecond after the frame before it)
            end_us = frame_us[-1] + max(1, math.ceil(latest_us(self.dvs.spec)))
            if not (start_us == frame_us[0] and start_us + duration_us <= end_us):
                raise ValueError("times that are not those of its frames")
        return Recording(
            self.dvs.size,
            start_us,
            duration_us,
            self.events,
            lambda: self._columns.blocks(BLOCK),
            self.dvs.labels,
            partial(self._pictures_of, frame_us) if self._pictures and self.outputs.want_frames else None,
            frame_us,
        )

    def _pictures_of(self, frame_us: np.ndarray) -> Iterator[Picture]:
        """The pictures of the frames that were recorded: the source may have some before and after them."""
        assert self._pictures
        coming = dropwhile(lambda picture: picture.t_us < frame_us[0], self._pictures())
        return takewhile(lambda picture: picture.t_us <= frame_us[-1], coming)
