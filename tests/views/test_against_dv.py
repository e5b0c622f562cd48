"""Slices and surfaces of active events against iniVation's dv-processing."""

from __future__ import annotations

from datetime import timedelta
from fractions import Fraction

import numpy as np
import pytest

from vid2ev.stream.events import Events
from vid2ev.views.representation import slices_of
from vid2ev.views.slices import Count, Duration
from vid2ev.views.time_surface import NEVER, ActiveEvents

from .recordings import SIZE, events_at, recording_of

dv = pytest.importorskip("dv_processing")
T = 1 + np.sort(np.random.default_rng(2).integers(0, 200_000, 3000))


def store_of(events: Events) -> object:
    store = dv.EventStore()
    for t, x, y, p in zip(*(getattr(events, name).tolist() for name in "txyp"), strict=True):
        store.push_back(t, x, y, bool(p))
    return store


def test_the_surface_of_active_events() -> None:
    events = events_at(T)
    theirs = dv.TimeSurface(SIZE)
    theirs.accept(store_of(events))
    ours = ActiveEvents(SIZE)
    ours.add(events)
    newest = ours.take(0).max(axis=0)  # theirs has no polarities, and 0 where there was no event
    for y in range(SIZE[1]):
        for x in range(SIZE[0]):
            assert theirs.at(y, x) == (0 if newest[y, x] == NEVER else newest[y, x])


def test_slices_by_count() -> None:
    sizes: list[int] = []
    slicer = dv.EventStreamSlicer()
    slicer.doEveryNumberOfElements(450, lambda part: sizes.append(part.size()))
    slicer.accept(store_of(events_at(T)))
    found = [part.events for part in slices_of(recording_of(events_at(T)), Count(450))]
    assert found[:-1] == sizes  # theirs leaves out the last, incomplete one
    assert sum(found) == len(T)


def test_slices_by_duration() -> None:
    # theirs are [a, b) from the first event, ours (a, b]: the same for times that are not at an edge
    t = np.unique(T) * 10 + 5
    t[0] = 0
    sizes: list[int] = []
    slicer = dv.EventStreamSlicer()
    slicer.doEveryTimeInterval(timedelta(milliseconds=10), lambda part: sizes.append(part.size()))
    slicer.accept(store_of(events_at(t)))
    found = [part.events for part in slices_of(recording_of(events_at(t)), Duration(Fraction(10_000)))]
    assert found[: len(sizes)] == sizes and len(found) - len(sizes) <= 1
