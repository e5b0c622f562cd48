"""Pictures of events behind a dead time: those of the light that was there, however the stream is cut."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interp.networks import make
from interp.reconstruct import reconstruct
from interp.reconstruct.high_pass import GREY, HighPass
from interp.reconstruct.made_good import MadeGood
from interp.reconstruct.of_network import OfNetwork
from interp.representation.dead_time import DeadTime, Law
from interp.weights import save
from vid2ev import Dvs, Events, load_sensor
from vid2ev.formats import format_named
from vid2ev.formats.event_file import Recording

SIZE, BLIND_US, THRESHOLD = (16, 4), 1000.0, 0.15
STARTS, RISE, SLICE_US, SLICES = 10_000, np.linspace(0.2, 3.0, 64, dtype=np.float32).reshape(4, 16), 5_000, 12


class Listening:
    """A reconstructor that only hears what events count for."""

    name = "listening"

    def __init__(self) -> None:
        self.worth: list[np.ndarray] = []

    def add(self, events: Events, start_us: int, stop_us: int, worth: np.ndarray | None = None) -> None:
        assert worth is not None and len(worth) == len(events)
        self.worth.append(worth)

    def picture(self, stop_us: int) -> np.ndarray:
        return np.zeros(SIZE[::-1], np.float32)

    def memory(self) -> dict[str, np.ndarray]:
        return {}

    def remember(self, memory: dict[str, np.ndarray]) -> None:
        assert memory == {}


def sent(law: Law, blind_us: float) -> Events:
    """Of 64 pixels whose log light rises evenly for 40 ms, by `RISE`."""
    blind = [f"refractory_us={blind_us}", f'refractory="{law}"']
    dvs = Dvs(load_sensor("ideal", [f"threshold_on={THRESHOLD}", f"threshold_off={THRESHOLD}", *blind]), SIZE)
    shares = [0.0, 0.0, *np.linspace(0, 1, 81)[1:], 1.0]
    times_us = [0, STARTS, *(STARTS + 500 * k for k in range(1, 81)), SLICE_US * SLICES]
    light = [np.float32(0.02) * np.exp(np.float32(share) * RISE) for share in shares]
    return Events.concatenate([dvs.step(each, 1000 * t_us) for each, t_us in zip(light, times_us, strict=True)])


def pieces(events: Events, edges: list[int]) -> list[Events]:
    """The events up to each of the edges, and the rest."""
    places = [0, *np.searchsorted(events.t, sorted(edges), side="right"), len(events)]
    return [events.stretch(int(a), int(b)) for a, b in pairwise(places)]


@given(st.lists(st.integers(0, 60_000), max_size=12), st.integers(0, 12))
def test_of_a_memory_that_tracks_events_count_the_same_however_the_stream_is_cut(edges: list[int], at: int) -> None:
    """Also where it is gone on with by another process."""
    dead_time, events = DeadTime(BLIND_US), sent("track", BLIND_US)
    heard = Listening()
    seen = MadeGood(heard, dead_time, SIZE)
    for k, part in enumerate(pieces(events, edges)):
        seen.add(part.stretch(0, len(part) // 2), 0, 60_000)
        seen.add(part.stretch(len(part) // 2, len(part)), 0, 60_000)
        seen.picture(60_000)
        if k == at:
            memory, seen = seen.memory(), MadeGood(heard, dead_time, SIZE)
            seen.remember(memory)
    pixel = events.y.astype(np.int64) * SIZE[0] + events.x
    np.testing.assert_array_equal(np.concatenate(heard.worth), dead_time.crossings(events.t, pixel, events.p))


@pytest.mark.parametrize(("law", "left"), [("track", 0.15), ("quantised", 0.7)])
def test_light_is_what_it_was(law: Law, left: float) -> None:
    """That of a memory that is quantised is so only in part: a slice of few events says little of it."""
    off = []
    for dead_time in (None, DeadTime(BLIND_US, law)):
        high_pass = HighPass(SIZE, (THRESHOLD, THRESHOLD), cutoff_hz=0)
        seen = MadeGood(high_pass, dead_time, SIZE) if dead_time else high_pass
        for k, part in enumerate(pieces(sent(law, BLIND_US), [SLICE_US * k for k in range(1, SLICES)])):
            seen.add(part, SLICE_US * k, SLICE_US * (k + 1))
            light = seen.picture(SLICE_US * (k + 1))
        off.append(RISE - np.log(light / GREY))
    within = THRESHOLD / 2  # of a threshold, what is left is anything
    assert off[0].mean() > within
    assert abs(off[1].mean() - within) < left * (off[0].mean() - within) + 0.02


@pytest.mark.parametrize("name", ["firenet", "e2vid"])
def test_a_network_sees_events_as_often_as_they_count(tmp_path: Path, name: str) -> None:
    """As if each were sent so often."""
    save(tmp_path / "some.safetensors", name, make(name).eval())
    events, worth = sent("track", BLIND_US), np.random.default_rng(0).integers(1, 4, 10_000)
    worth, pictures = worth[: len(events)], []
    again = np.repeat(np.arange(len(events)), worth)
    often = Events(*(column[again] for column in (events.t, events.x, events.y, events.p)))
    for some, each in ((events, worth.astype(np.float32)), (often, None)):
        seen = OfNetwork(tmp_path / "some.safetensors", SIZE, (0.2, 0.3))
        seen.add(some, 0, 60_000, each)
        pictures.append(seen.picture(60_000))
    np.testing.assert_allclose(*pictures, atol=1e-6)


def recording(folder: Path, parameters: dict[str, Any]) -> Path:
    """A recording of the 64 pixels by a sensor of which the manifest says that."""
    folder.mkdir()
    kind, events = format_named("npz"), sent("track", BLIND_US)
    assert kind.write is not None
    kind.write(folder / "events.npz", Recording(SIZE, 0, 60_000, len(events), lambda: iter([events])))
    sensor = {"parameters": {"threshold_on": THRESHOLD, "threshold_off": THRESHOLD} | parameters}
    (folder / "manifest.json").write_text(json.dumps({"versions": {"vid2ev": "0"}, "sensor": sensor}))
    return folder


def test_what_the_recording_says_is_made_good_unless_something_else_is_asked(tmp_path: Path) -> None:
    said = {"refractory_us": BLIND_US, "refractory": "track", "timing": "response", "frame_rate_hz": 0.0}
    path = recording(tmp_path / "saying", said)
    given: dict[str, Any] = {"cutoff_hz": 0, "fps": 200, "format": "exr"}
    asked = {"said": {}, "none": {"refractory_us": 0}, "other": {"refractory_us": 500}}
    made = {name: reconstruct(path, tmp_path / name, **given, **options) for name, options in asked.items()}
    times = {name: each["source"]["dead_time"] for name, each in made.items()}
    assert times["said"] == {"refractory_us": BLIND_US, "law": "track"} and times["none"] is None
    assert times["other"] == {"refractory_us": 500, "law": "track"}
    silent = recording(tmp_path / "saying nothing", {})
    made = {name: reconstruct(silent, tmp_path / f"{name} 2", **given, **options) for name, options in asked.items()}
    assert made["said"]["source"]["dead_time"] is None is made["none"]["source"]["dead_time"]
    same = (tmp_path / "none" / "000009.exr").read_bytes()
    assert (tmp_path / "said 2" / "000009.exr").read_bytes() == same
    assert (tmp_path / "said" / "000009.exr").read_bytes() != same
    assert math.isclose(made["other"]["source"]["dead_time"]["refractory_us"], 500)
