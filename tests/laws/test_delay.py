"""A delay: the same events, later; nothing from before a cut, nothing after the end; a state like any other."""

from __future__ import annotations

import numpy as np
from against.clips import clean

from vid2ev.sensors.dvs import Dvs
from vid2ev.stream import Events, Frame

SIZE = (16, 12)


def frames(seed: int = 1, count: int = 30) -> list[Frame]:
    level = np.cumsum(np.random.default_rng(seed).normal(0, 0.3, (count, SIZE[1], SIZE[0])), axis=0) - 1
    return [Frame(np.exp(light).astype(np.float32), k * 1_000_000) for k, light in enumerate(level)]


def all_of(dvs: Dvs, seen: list[Frame]) -> Events:
    return Events.concatenate(list(dvs.run(seen)))


def same(a: Events, b: Events) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in "txyp")


def test_the_same_events_later() -> None:
    plain, late = (all_of(Dvs(clean(filter="after", delay_us=us), SIZE), frames()) for us in (0, 2345.6))
    due = plain.select(plain.t + 2346 <= 29_000)
    assert 0 < len(due) < len(plain)
    assert same(late, Events(due.t + 2346, due.x, due.y, due.p))


def test_each_step_gives_what_is_due() -> None:
    dvs = Dvs(clean(filter="after", delay_us=2500), SIZE)
    for frame in frames():
        events = dvs.see(frame)
        assert not len(events) or (events.t[0] > frame.t_ns // 1000 - 1000 and events.t[-1] <= frame.t_ns // 1000)


def test_what_is_held_is_forgotten_at_a_cut() -> None:
    seen = frames()
    seen[15] = Frame(seen[15].light, seen[15].t_ns, cut=True)
    plain, late = (all_of(Dvs(clean(filter="after", delay_us=us), SIZE), seen) for us in (0, 2500))
    due = plain.select((plain.t + 2500 <= 29_000) & ((plain.t + 2500 <= 14_000) | (plain.t > 15_000)))
    assert same(late, Events(due.t + 2500, due.x, due.y, due.p))


def test_a_restored_state_goes_on_alike() -> None:
    spec, seen = clean(filter="after", delay_us=2500, frame_rate_hz=500), frames()
    whole, first, second = Dvs(spec, SIZE), Dvs(spec, SIZE), Dvs(spec, SIZE)
    a = [first.see(frame) for frame in seen[:11]]
    second.restore(first.state())
    b = [second.see(frame) for frame in seen[11:]]
    assert same(all_of(whole, seen), Events.concatenate([*a, *b, second.flush()]))
    assert whole.counts == second.counts


def test_labels_stay_with_their_events() -> None:
    seen = frames()[:15] + [Frame(frames()[14].light, k * 1_000_000) for k in range(15, 60)]
    spec = clean(filter="after", leak_rate_hz=50)
    sensors = (Dvs(spec.model_copy(update={"delay_us": us}), SIZE, labels=True) for us in (0.0, 2500.0))
    plain, late = (all_of(dvs, seen) for dvs in sensors)
    due = plain.select(plain.t + 2500 <= 59_000)
    assert late.label is not None and due.label is not None and len(set(due.label)) == 2
    assert same(late, Events(due.t + 2500, due.x, due.y, due.p)) and np.array_equal(late.label, due.label)
