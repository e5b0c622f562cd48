"""Recordings of `vid2ev convert` as sequences: an event camera, and frame cameras beside it.

Of several frame cameras, the slowest has the key frames, and the fastest of those that see the same as it does the
frames to rebuild, as `vid2ev dataset` writes them.  Of several event cameras the first that sees the same counts, or
else the first.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch

from interp.data.layouts.calibration import Calibration
from interp.data.layouts.maps import Maps
from interp.data.layouts.sequence import Placed
from interp.own_codes import codes_of, light_of
from interp.representation.carried import Look
from interp.representation.dead_time import DeadTime
from interp.representation.event_counts import contrast_of
from vid2ev import CisSpec, DataError, UsageError, read_events
from vid2ev.formats import open_events, recognise
from vid2ev.recording.exposures import KINDS, LATEST_US, TIMESTAMPS, read_codes, read_spans
from vid2ev.recording.manifest import as_stated, read_manifest

MANIFEST, TRUTH = "manifest.json", "truth"
MOST_PIXELS = 1 << 16  # of a side of a sensor
ROUNDED_US = 2  # that two instants which are the same may be apart in files


class Own:
    """The recording in a folder.

    keys_folder     the pictures of the slow frame camera
    grey            whether these have no colours
    events_folder   what the event camera wrote
    late_us         by how much its clock is ahead of that of the slow frame camera
    Where there are no pictures of 8 bits (`--cis-out png`), they are made of the codes of the ADC, as those would be.
    Of frame cameras whose pictures have different curves (`cis.gamma`) both are brought to that of the slow one.
    Raises DataError for a recording that has no events or no frames, or whose events cannot be read.
    """

    def __init__(self, folder: Path):
        self.name, self.folder, self.remarks = folder.name, folder, list[str]()
        cameras, calibration = _cameras(folder), Calibration(folder / MANIFEST)
        frames = sorted((each for each in cameras if each["kind"] == "cis"), key=lambda each: each["rate_hz"])
        events = [each for each in cameras if each["kind"] == "dvs"]
        if not events or not frames:
            raise DataError(f"{folder}: {_lack(folder, bool(events))}")
        keys = frames[0]
        beside = {each["name"]: calibration.apart(keys["name"], each["name"]) for each in cameras}
        alike = [each for each in frames if each["size"] == keys["size"] and not beside[each["name"]]]
        sent = next((each for each in events if not beside[each["name"]]), events[0])
        self.remarks += [
            f"its camera {each['name']} is left out: it sees other pictures than {keys['name']}"
            for each in frames
            if each not in alike
        ]
        self.remarks += [
            f"its camera {each['name']} is left out: the events are those of {sent['name']}"
            for each in events
            if each is not sent
        ]
        self.curve: str = keys["curve"]
        self._keys, self._frames = _Pictures(keys, self.curve), _Pictures(alike[-1], self.curve)
        self.keys_folder, self.events_folder = keys["folder"], sent["folder"]
        _check_events(self.events_folder)
        self.times_us, key_times = self._frames.times_us, self._keys.times_us
        self._key_of = {
            int(k): number
            for number, t in enumerate(key_times)
            if abs(int(self.times_us[k := np.abs(self.times_us - t).argmin()]) - int(t)) <= ROUNDED_US
        }
        self.size, self.grey = self._frames.codes(0).shape[1::-1], self._keys.codes(0).ndim == 2
        self.event_size = tuple(sent["size"])
        self.contrast, self.dead_time = sent["contrast"], sent["dead_time"]
        self.apart, self.late_us = beside[sent["name"]], calibration.late_us(keys["name"], sent["name"])
        self._calibrated = calibration.look(keys["name"], self.size, sent["name"]) if self.apart else None
        self._maps = Maps(self.keys_folder.parent / TRUTH, sent["name"], self.size)
        self._span_us = sent["span_us"]

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

    @property
    def slow_us(self) -> np.ndarray:
        """When the slow camera took its pictures, int64, whether or not there is a frame of that instant."""
        return self._keys.times_us

    def slow(self, number: int) -> np.ndarray:
        """Its picture of a number."""
        return self._keys.rgb(number)

    def frame(self, k: int) -> np.ndarray:
        """Frame k of the fast camera."""
        return self._frames.rgb(k)

    def key(self, k: int) -> np.ndarray:
        """The frame of the slow camera at that instant, if there is one."""
        return self._keys.rgb(self._key_of[k]) if k in self._key_of else self.frame(k)

    def exposure_us(self, k: int) -> float:
        """How long the camera that took key frame k exposes a frame; 0 of one that sees an instant."""
        return (self._keys if k in self._key_of else self._frames).exposure_us

    def looks(self, t_us: int) -> tuple[Look, ...]:
        """As the cameras stand, if they stand apart; by the map that was recorded then (`--truth map`), too, where that
        is not all there is to know."""
        stand = self._calibrated
        if stand is None:
            return ()
        if stand.exact or (seen := self._maps.near(t_us)) is None:
            return (stand,)
        return stand, Look(torch.where(seen.isnan(), stand.where, seen), exact=False)

    def events(self, start_us: int, stop_us: int) -> Placed:
        """The events in (start_us, stop_us]."""
        parts = list(read_events(self.events_folder, start_us + 1, stop_us + 1))
        t, x, y, p = (np.concatenate([getattr(each, name) for each in parts] or [np.empty(0)]) for name in "txyp")
        return Placed(t.astype(np.int64), x.astype(np.float32), y.astype(np.float32), p.astype(np.uint8))


def _lack(folder: Path, events: bool) -> str:
    """What a recording would need, and has not."""
    if not events:
        return "a recording of frames alone; convert its video with an event camera in the rig, or without a rig"
    if any(folder.glob(f"*/{KINDS['mp4']}")):
        return "its frames are in a film alone, which has not their times; convert its video with --cis-out raw"
    files = sorted(path for held in ("events.*", "*/events.*") for path in folder.glob(held) if path.is_file())
    with_frames = (path for path in files if "frames" in _kept_in(path))
    if file := next(with_frames, None):
        return f"a recording without frames of a frame camera; give {file}, which has frames of its source"
    return "a recording without frames; convert its video with --frames"


def _kept_in(path: Path) -> frozenset[str]:
    """What an event file may have beside its events."""
    kind = recognise(path)
    return frozenset() if kind is None else kind.keeps


def _check_events(folder: Path) -> None:
    """Raise DataError where the events of a camera are missing or cut short: now, not when the first are asked for."""
    try:
        open_events(folder)
    except UsageError as error:
        raise DataError(
            f"{folder}: its manifest speaks of events, and there are none; copy the recording again"
        ) from error


def _cameras(folder: Path) -> list[dict[str, Any]]:
    """Kind, folder and what else matters of each camera of a recording."""
    found = []
    for path in [folder / MANIFEST, *sorted(folder.glob(f"*/{MANIFEST}"))]:
        with as_stated(path):
            facts = _facts(read_manifest(path), path.parent)
        found += [facts] if facts else []
    return found


def _facts(said: dict[str, Any], folder: Path) -> dict[str, Any] | None:
    """What the manifest of a camera says; None of one without pictures, or of all cameras.  Raises KeyError,
    TypeError, ValueError for what no manifest says."""
    sensor = said.get("sensor")
    if sensor is None or (sensor["kind"] == "cis" and _pictures_in(folder) is None):
        return None
    numbers = sensor["parameters"]
    width, height = (_whole(side, 1, MOST_PIXELS) for side in sensor["size"])
    facts = {"kind": sensor["kind"], "name": folder.name, "folder": folder, "size": (width, height)}
    if sensor["kind"] == "cis":
        rate_hz, curve = float(numbers["frame_rate_hz"]), CisSpec(**{"gamma": numbers.get("gamma", "srgb")}).curve
        return facts | {"folder": _pictures_in(folder), "rate_hz": rate_hz, "curve": curve, "numbers": numbers}
    begin, length = (_whole(said[key], -LATEST_US, LATEST_US) for key in ("start_us", "duration_us"))
    known = {"contrast": contrast_of(numbers), "dead_time": DeadTime.of(numbers)}
    return facts | known | {"span_us": (begin, begin + length)}


def _whole(said: Any, least: int, most: int) -> int:
    """A whole number of a manifest.  Raises TypeError, ValueError for one that is none, or out of its limits."""
    if not least <= int(said) <= most:
        raise ValueError(f"{said}, not {least} ... {most}")
    return int(said)


class _Pictures:
    """Pictures of 8 bits of a frame camera, by a transfer curve."""

    def __init__(self, facts: dict[str, Any], curve: str):
        self._folder: Path = facts["folder"]
        self._size: tuple[int, int] = facts["size"]
        raw = self._folder.name == KINDS["raw"]
        with as_stated(self._folder.parent / MANIFEST):
            self._picture = CisSpec(**facts["numbers"]).picture_codes() if raw else None
            blurred = facts["numbers"].get("blur", True)
            # (of a row; all of them may take longer)
            self.exposure_us = float(facts["numbers"]["exposure_us"]) if blurred else 0.0
        if facts["curve"] != curve:
            by_curve = codes_of(light_of(facts["curve"]), curve)
            self._picture = by_curve if self._picture is None else by_curve[self._picture]
        opened = read_spans(self._folder / TIMESTAMPS)
        self.times_us = opened.sum(axis=1) // 2  # the middles of the exposures

    def codes(self, number: int) -> np.ndarray:
        """Codes uint8, [H, W] or [H, W, 3]."""
        codes = read_codes(self._folder / f"{number:06d}.png")
        if codes.shape[1::-1] != self._size:
            (width, height), (wide, high) = codes.shape[1::-1], self._size
            raise DataError(
                f"{self._folder / f'{number:06d}.png'}: {width}x{height} pixels, expected {wide}x{high} as its manifest"
                " says; copy the recording again"
            )
        if self._picture is None:
            return codes
        if codes.max(initial=0) >= len(self._picture):
            raise DataError(f"{self._folder / f'{number:06d}.png'}: code {codes.max()}, beyond those of its sensor")
        return self._picture[codes]

    def rgb(self, number: int) -> np.ndarray:
        """Red, green, blue [H, W, 3], uint8."""
        codes = self.codes(number)
        return codes if codes.ndim == 3 else np.repeat(codes[..., None], 3, axis=2)


def _pictures_in(folder: Path) -> Path | None:
    """Where a frame camera has its pictures: those of 8 bits, or else the codes of the ADC."""
    places = (folder / KINDS[kind] for kind in ("png", "raw"))
    return next((place for place in places if (place / TIMESTAMPS).exists()), None)
