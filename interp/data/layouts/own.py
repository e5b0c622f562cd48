"""Recordings of `vid2ev convert` as sequences: an event camera, and frame cameras beside it.

Of several frame cameras, the fastest has the frames to rebuild, and the slowest the key frames, as `vid2ev dataset`
writes them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from interp.data.layouts.sequence import Placed
from vid2ev import DataError, read_events
from vid2ev.recording.exposures import KINDS, TIMESTAMPS, read_codes
from vid2ev.recording.manifest import read_manifest
from vid2ev.rig.rig_file import read_rig

MANIFEST = "manifest.json"
ROUNDED_US = 2  # that two instants which are the same may be apart in files


class Own:
    """The recording in a folder.

    keys_folder     the pictures of the slow frame camera
    events_folder   what the event camera wrote
    Raises DataError for a recording that has no events or no frames in 8 bits.
    """

    def __init__(self, folder: Path):
        self.name, self.folder, self.remarks = folder.name, folder, list[str]()
        cameras = _cameras(folder)
        frames = sorted((each for each in cameras if each["kind"] == "cis"), key=lambda each: each["rate_hz"])
        events = [each for each in cameras if each["kind"] == "dvs"]
        if not events or not frames:
            raise DataError(
                f"{folder}: a recording without events or frames in 8 bits; expected --cis-out png with --frames"
            )
        self.keys_folder, self._frames, self.events_folder = (
            frames[0]["folder"],
            frames[-1]["folder"],
            events[0]["folder"],
        )
        self.times_us, key_times = (_times_us(each) for each in (self._frames, self.keys_folder))
        self._key_of = {
            int(k): number
            for number, t in enumerate(key_times)
            if abs(int(self.times_us[k := np.abs(self.times_us - t).argmin()]) - int(t)) <= ROUNDED_US
        }
        self.size = read_codes(self._frames / "000000.png").shape[1::-1]
        self.event_size = tuple(events[0]["size"])
        self.contrast = events[0]["contrast"]
        self._span_us = events[0]["span_us"]

    @property
    def covered_us(self) -> tuple[int, int]:
        """The time of the recording."""
        return self._span_us

    @property
    def unknown_us(self) -> list[tuple[int, int]]:
        """Nothing: a recording is there as a whole or not at all."""
        return []

    @property
    def key_frames(self) -> list[int]:
        """Frames of which there is a key frame of the slow camera."""
        return sorted(self._key_of)

    def frame(self, k: int) -> np.ndarray:
        """Frame k of the fast camera."""
        return _rgb(self._frames, k)

    def key(self, k: int) -> np.ndarray:
        """The frame of the slow camera at that instant, if there is one."""
        return _rgb(self.keys_folder, self._key_of[k]) if k in self._key_of else self.frame(k)

    def events(self, start_us: int, stop_us: int) -> Placed:
        """The events in (start_us, stop_us]."""
        parts = list(read_events(self.events_folder, start_us + 1, stop_us + 1))
        t, x, y, p = (np.concatenate([getattr(each, name) for each in parts] or [np.empty(0)]) for name in "txyp")
        return Placed(t.astype(np.int64), x.astype(np.float32), y.astype(np.float32), p.astype(np.uint8))

    def rig(self) -> Any:
        """The rig of the recording (`vid2ev.rig.camera.Rig`), or None of a single place."""
        path = self.folder / "rig.toml"
        return read_rig(path) if path.exists() else None


def _cameras(folder: Path) -> list[dict[str, Any]]:
    """Kind, folder and what else matters of each camera of a recording."""
    found = []
    for path in [folder / MANIFEST, *sorted(folder.glob(f"*/{MANIFEST}"))]:
        said = read_manifest(path)
        sensor = said.get("sensor")
        if sensor is None or (sensor["kind"] == "cis" and not (path.parent / KINDS["png"] / TIMESTAMPS).exists()):
            continue
        numbers, begin = sensor["parameters"], said["start_us"]
        facts = {"kind": sensor["kind"], "folder": path.parent, "size": sensor["size"]}
        if sensor["kind"] == "cis":
            facts |= {"folder": path.parent / KINDS["png"], "rate_hz": numbers["frame_rate_hz"]}
        else:
            facts["contrast"] = (numbers["threshold_off"], numbers["threshold_on"])
            facts["span_us"] = (begin, begin + said["duration_us"])
        found.append(facts)
    return found


def _times_us(folder: Path) -> np.ndarray:
    """The middles of the exposures [us]."""
    opened = np.loadtxt(folder / TIMESTAMPS, dtype=np.int64, ndmin=2)
    return opened.sum(axis=1) // 2


def _rgb(folder: Path, number: int) -> np.ndarray:
    codes = read_codes(folder / f"{number:06d}.png")
    return codes if codes.ndim == 3 else np.repeat(codes[..., None], 3, axis=2)
