"""What grows while a recording is made: events, the preview, the instants of the frames, probed pixels; all with one
checkpoint, so that whatever is interrupted fits together again."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, field

import numpy as np

from vid2ev.formats.event_file import BLOCK, Recording
from vid2ev.outputs import Outputs
from vid2ev.recipe import Recipe
from vid2ev.recording.disk import write_npz
from vid2ev.recording.folder import Folder
from vid2ev.recording.preview import Preview, rate_for
from vid2ev.recording.probe import HEADER, Probe, plot
from vid2ev.sensors.dvs import Dvs
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame

FRAME_US, PROBE = "frame_us", "probe.csv"  # files of the folder that grow beside the events


def growing(outputs: Outputs) -> list[str]:
    """The files beside the events that a folder is to be made with."""
    return [FRAME_US, *[PROBE] * bool(outputs.probe)]


@dataclass
class Progress:
    """How far a conversion is."""

    frames: int = 0  # of the source
    subframes: int = 0  # made between them
    limited: int = 0  # source intervals that hit max_subframes
    events: int = 0
    start_ns: int = 0  # the first frame
    end_ns: int = 0  # the last frame
    last_us: int = 0  # the last event
    cuts_us: list[int] = field(default_factory=list)  # the first frames of new shots
    seconds: float = 0.0  # of work, in all runs
    finished: bool = False
    warnings: list[str] = field(default_factory=list)

    def add(self, frame: Frame, events: Events) -> None:
        """Count a frame and the events up to it."""
        self.frames += frame.original
        self.subframes += not frame.original
        self.end_ns = frame.t_ns
        self.cuts_us += [frame.t_ns // 1000] * frame.cut
        self.count(events)

    def count(self, events: Events) -> None:
        """Count events."""
        self.events += len(events)
        self.last_us = int(events.t[-1]) if len(events) else self.last_us

    @property
    def offset_us(self) -> int:
        """The instant from which an event file counts: the first frame."""
        return self.start_ns // 1000

    @property
    def duration_us(self) -> int:
        """From the first frame to the last, or to the last event where the sensor's readout makes it later."""
        return max(self.end_ns // 1000, self.last_us) - self.offset_us


class Recorder:
    """Puts frames and events into a folder; `done` is how far it is.

    `take_up` comes first, then `begin` with the first frame (or the last one before the checkpoint), `add` for each
    that follows and now and then `checkpoint`, and in the end `finish` and `write`.
    """

    def __init__(self, recipe: Recipe, dvs: Dvs, outputs: Outputs, folder: Folder):
        self.recipe, self.dvs, self.outputs, self.folder = recipe, dvs, outputs, folder
        self.done = Progress()
        rate = rate_for(recipe.source.frames_expected, recipe.source.duration_expected_s)
        self._film = Preview(recipe.source.size, folder.partial, wanted=outputs.preview, rate=rate)
        self._probe = Probe(outputs.probe, recipe.source.size[0]) if outputs.probe else None

    def take_up(self) -> None:
        """Bring everything to the point of the folder's last checkpoint, if there is one."""
        saved = self.folder.saved()
        if saved:
            for part, name in ((self.dvs, "dvs."), (self._film, "film.")):
                part.restore({key.removeprefix(name): array for key, array in saved.items() if key.startswith(name)})
            self.done = Progress(**json.loads(str(saved["progress"])))

    def begin(self, frame: Frame) -> None:
        """The first frame of the recording; after `take_up`, the last source frame before the checkpoint."""
        self._film.begin(frame)
        if not self.done.frames:
            self.dvs.step(frame.light, frame.t_ns)
            self.done.frames, self.done.start_ns, self.done.end_ns = 1, frame.t_ns, frame.t_ns
            with self.folder.writing():
                self._note(frame)
                if self._probe:
                    self.folder.write(PROBE, HEADER)
                    self._look_inside(frame, Events.empty())

    def add(self, frame: Frame) -> None:
        """The next frame, and what the sensor makes of it."""
        events = self.dvs.see(frame)
        with self.folder.writing():
            self.folder.append(events)
            self._film.add(frame, events)
            self._note(frame)
            self._look_inside(frame, events)
        self.done.add(frame, events)

    def finish(self) -> None:
        """What the sensor held back, and the last checkpoint."""
        events = self.dvs.flush()
        with self.folder.writing():
            self.folder.append(events)
            self._film.finish(events)
            if self._probe:
                self.folder.write(PROBE, "".join(self._probe.event_lines(events)).encode())
        self.done.count(events)
        self.done.finished = True
        self.checkpoint()

    def checkpoint(self) -> None:
        """Make this the point from which an interrupted recording goes on."""
        with self.folder.writing():
            self._film.close()
            state = {f"dvs.{name}": array for name, array in self.dvs.state().items()}
            state |= {f"film.{name}": array for name, array in self._film.state().items()}
            self.folder.checkpoint(state | {"progress": np.array(json.dumps(asdict(self.done)))})

    def write(self) -> None:
        """The files of the recording, but for its manifest."""
        whole = self.folder.whole
        self.outputs.write(whole, self._recording())
        self._film.join(whole / "preview.mp4")
        if self._probe:
            shutil.copyfile(self.folder.written(PROBE), whole / PROBE)
            plot(whole / PROBE, whole / "probe.png")
        if self.outputs.noise_maps:
            write_npz(whole / "noise_maps.npz", self.dvs.maps())

    def _note(self, frame: Frame) -> None:
        if frame.original:
            self.folder.write(FRAME_US, np.int64(frame.t_ns // 1000).tobytes())

    def _look_inside(self, frame: Frame, events: Events) -> None:
        if self._probe:
            self.folder.write(PROBE, self._probe.lines(frame, events, self.dvs.inside(self._probe.places)))

    def _recording(self) -> Recording:
        """What event files are written from."""
        with_frames = self.outputs.want_frames and self.recipe.source.rewindable
        return Recording(
            self.recipe.source.size,
            self.done.offset_us,
            self.done.duration_us,
            self.done.events,
            lambda: self.folder.events(BLOCK),
            self.recipe.labels,
            self.recipe.pictures if with_frames else None,
            np.fromfile(self.folder.written(FRAME_US), np.int64),
        )
