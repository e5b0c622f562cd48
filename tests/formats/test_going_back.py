"""Times that go back are put in order, exactly, and a reader is told."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings import events_of

from vid2ev import DataError
from vid2ev.formats import describe_events, open_events, survey
from vid2ev.formats.order import Disorder, ordered
from vid2ev.stream.events import Events


def blocks_of(t: list[int], block: int) -> list[Events]:
    events = events_of(np.array(t, np.int64), (50, 50))
    return [events.select(np.arange(at, min(at + block, len(t)))) for at in range(0, len(t), block)]


@given(st.lists(st.integers(0, 60), max_size=80), st.integers(1, 20))
@settings(max_examples=150)
def test_any_disorder_is_put_in_order(t: list[int], block: int) -> None:
    blocks, disorder = blocks_of(t, block), Disorder()
    for events in blocks:
        disorder.add(events.t)
    latest = [max(t[: k + 1]) - at for k, at in enumerate(t)]
    assert disorder.depth_us == max(latest, default=0)
    assert disorder.places == sum(b < a for a, b in pairwise(t))
    made = list(ordered(iter(blocks), disorder.depth_us))
    whole, result = Events.concatenate(blocks), Events.concatenate(made)
    order = np.argsort(whole.t, kind="stable")
    for name in "txyp":
        np.testing.assert_array_equal(getattr(result, name), getattr(whole, name)[order])


far = st.sampled_from([0, 1, 2**62, 2**62 + 5, 2**63 - 1]).flatmap(lambda at: st.sampled_from([at, -at, -at - 1]))


@given(st.lists(far, max_size=9), st.integers(1, 4))
@settings(max_examples=150)
def test_how_far_any_times_go_back_is_counted(t: list[int], block: int) -> None:
    disorder = Disorder()
    for at in range(0, len(t), block):
        disorder.add(np.array(t[at : at + block], np.int64))
    assert disorder.depth_us == max((max(t[: k + 1]) - at for k, at in enumerate(t)), default=0)
    assert disorder.places == sum(b < a for a, b in pairwise(t))


@pytest.mark.parametrize("t", [[-(2**62), 0], [0, 2**62], [-(2**63), 2**63 - 1], [2**63 - 1, -(2**63)]])
def test_times_of_no_year_are_not_compared_or_written_anew(tmp_path: Path, t: list[int]) -> None:
    """Their differences, or twice as much, would be other numbers."""
    none = np.zeros(2, np.uint8)
    np.savez(tmp_path / "events.npz", t=np.array(t, np.int64), x=none, y=none, p=none)
    with pytest.raises(DataError, match=r"times beyond 146,000 years|go back by"):
        survey(open_events(tmp_path / "events.npz"))


def test_events_wait_no_longer_than_they_must() -> None:
    blocks = blocks_of(list(range(0, 10_000, 10)), 100)
    longest = seen = 0
    for made, events in zip(ordered(iter(blocks), 50), blocks, strict=False):
        seen += len(events) - len(made)
        longest = max(longest, seen)
    assert longest <= 6


def test_a_file_out_of_order_is_taken_with_a_warning(tmp_path: Path) -> None:
    t = [5, 3, 8, 8, 7, 20]
    lines = ["t,x,y,p", *(f"{at},{k},0,1" for k, at in enumerate(t)), ""]
    (tmp_path / "events.csv").write_text("\n".join(lines))
    found = describe_events(tmp_path / "events.csv")
    assert (found["times_going_back"], found["first_us"], found["last_us"]) == (2, 3, 20)
    file = open_events(tmp_path / "events.csv")
    recording = survey(file)
    events = Events.concatenate(recording.blocks())
    assert events.t.tolist() == [3, 5, 7, 8, 8, 20] and events.x.tolist() == [1, 0, 4, 2, 3, 5]
    assert file.warnings == ["times go back at 2 places, by at most 2 us: put in order"]
    assert recording.start_us == 0 and recording.duration_us == 20


def test_one_place_is_no_places(tmp_path: Path) -> None:
    (tmp_path / "events.csv").write_text("t,x,y,p\n5,0,0,1\n3,1,0,1\n9,0,0,1\n")
    file = open_events(tmp_path / "events.csv")
    survey(file)
    assert file.warnings == ["times go back at 1 place, by at most 2 us: put in order"]


def test_two_recordings_in_one_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "events.csv").write_text("t,x,y,p\n0,1,1,1\n100000000,1,1,0\n5,1,1,1\n")
    with pytest.raises(DataError, match="go back by 100 s"):
        survey(open_events(tmp_path / "events.csv"))
