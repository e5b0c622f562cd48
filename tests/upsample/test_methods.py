"""What holds for every method of upsampling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vid2ev import Dvs, load_sensor, upsample
from vid2ev.errors import UsageError
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.upsample import METHODS, make_upsampler


def two_frames(shape: tuple[int, int] = (48, 64), shift: int = 2, length_ns: int = 33_333_333) -> tuple[Frame, Frame]:
    """A smooth random texture before and after a shift to the right."""
    import cv2

    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.uniform(0, 1, (shape[0], shape[1] + shift)).astype(np.float32), (0, 0), 2)
    texture = (texture - texture.min()) / np.ptp(texture) + np.float32(0.02)
    before, after = texture[:, shift:], texture[:, : shape[1]]
    return Frame(before.copy(), 10**9), Frame(after.copy(), 10**9 + length_ns)


def in_colours(*frames: Frame) -> list[Frame]:
    """Grey frames in red, green and blue."""
    return [replace(frame, light=np.stack([frame.light] * 3, axis=-1)) for frame in frames]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("subframes", ["auto", 1, 2, 7])
def test_frames_of_the_source_pass_untouched(method: str, subframes) -> None:
    a, b = two_frames()
    kept = a.light.copy(), b.light.copy()
    made = list(make_upsampler(method, subframes).between(a, b))
    assert made[-1].light is b.light and made[-1].original
    assert not any(frame.original for frame in made[:-1])
    assert np.array_equal(a.light, kept[0]) and np.array_equal(b.light, kept[1])
    times = [a.t_ns, *(frame.t_ns for frame in made)]
    assert times == sorted(set(times))
    for frame in made[:-1]:
        assert frame.light.shape == a.light.shape and frame.light.dtype == np.float32
        assert np.isfinite(frame.light).all()


def test_a_name_of_which_nothing_is_made_is_no_optical_flow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(upsample, "METHODS", (*METHODS, "cubic"))
    with pytest.raises(NotImplementedError, match="cubic"):
        make_upsampler("cubic")


@pytest.mark.parametrize(("method", "subframes", "count"), [
    ("none", "auto", 1), ("none", 8, 1), ("linear", "auto", 1), ("linear", 8, 8), ("flow", 1, 1), ("flow", 8, 8),
])  # fmt: skip
def test_the_number_of_steps(method: str, subframes, count: int) -> None:
    assert len(list(make_upsampler(method, subframes).between(*two_frames()))) == count


def test_linear_is_the_line_between() -> None:
    a, b = two_frames()
    for frame in list(make_upsampler("linear", 5).between(a, b))[:-1]:
        share = (frame.t_ns - a.t_ns) / (b.t_ns - a.t_ns)
        np.testing.assert_allclose(frame.light, (1 - share) * a.light + share * b.light, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_an_interval_of_nanoseconds_is_not_divided_further(method: str) -> None:
    a, b = two_frames(length_ns=3)
    assert [frame.t_ns - a.t_ns for frame in make_upsampler(method, 50).between(a, b)] in ([3], [1, 2, 3])


@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_remembered_from_pair_to_pair(method: str) -> None:
    a, b = two_frames()
    c = Frame(np.roll(b.light, 3, axis=0), b.t_ns + 10_000_000)
    used = make_upsampler(method, 4)
    list(used.between(a, b))
    for one, other in zip(used.between(b, c), make_upsampler(method, 4).between(b, c), strict=True):
        assert one.t_ns == other.t_ns and np.array_equal(one.light, other.light)


@pytest.mark.parametrize("method", METHODS)
def test_frames_that_are_not_finite_do_not_stop_it(method: str) -> None:
    a, b = two_frames()
    a.light[5, 5], b.light[5, 5], b.light[40, 3] = np.inf, np.inf, np.nan
    assert list(make_upsampler(method, 3).between(a, b))[-1].light is b.light


@pytest.mark.parametrize("colours", [False, True])
@pytest.mark.parametrize("odd", [np.inf, -np.inf, np.nan, 3e38])
@pytest.mark.parametrize("method", METHODS)
def test_steady_light_that_is_none_is_steady_in_between(method: str, odd: float, colours: bool) -> None:
    """A pixel that is infinite in both frames sends nothing, beside a texture that moves; it is counted, whether a
    sensor looks at what it is told to be still or not."""
    a, b = two_frames((96, 128))
    for frame in (a, b):
        frame.light[60:, :] = 0.3
        frame.light[90, 100] = odd
    sent = []
    for skip in (True, False):
        dvs = Dvs(load_sensor("ideal"), (128, 96), skip=skip)
        frames = [a, *make_upsampler(method, 8).between(*(in_colours(a, b) if colours else (a, b)))]
        events = Events.concatenate([dvs.see(replace(frame, light=frame.luminance)) for frame in frames])
        assert len(events) > 1000 and not np.any((events.x == 100) & (events.y == 90))
        sent.append((events.t, dvs.counts["not_finite"]))
    assert np.array_equal(sent[0][0], sent[1][0]) and sent[0][1] == sent[1][1] >= 2


@pytest.mark.parametrize("arguments", [
    ("slow",), ("flow", 0), ("linear", -3), ("flow", "auto", 0), ("flow", 2, 9, 0.0), ("flow", 2, 9, float("nan")),
])  # fmt: skip
def test_refusals(arguments: tuple) -> None:
    with pytest.raises(UsageError, match="expected"):
        make_upsampler(*arguments)


@pytest.mark.parametrize("colours", [False, True])
@pytest.mark.parametrize("method", ["linear", "flow"])
def test_what_is_said_to_be_still_is(method: str, colours: bool) -> None:
    a, b = two_frames((70, 333))
    b.light[20:] = a.light[20:]
    b.light[66, 60], a.light[60, 0], b.light[60, 0] = np.nan, -1.0, -1.0
    if colours:
        a, b = in_colours(a, b)
        b.light[50, 300, 1] += 0.1
    before = a
    for frame in make_upsampler(method, 4).between(a, b):
        assert frame.still is not None and frame.still.before is before.light
        now, then = (light.reshape(70 * 333, -1) for light in (frame.light, before.light))
        same = (now == then).all(axis=1)
        assert all(same[256 * k : 256 * (k + 1)].all() for k in np.flatnonzero(frame.still.strips))
        assert len(frame.still.strips) == 92
        # Of the lower rows all is known but where something is odd, and where motion may reach down from above.
        odd = {(60 * 333) // 256, (66 * 333 + 60) // 256, *([(50 * 333 + 300) // 256] if colours else [])}
        known = np.array([k not in odd for k in range(55, 92)])
        assert np.array_equal(frame.still.strips[55:], known)
        before = frame
