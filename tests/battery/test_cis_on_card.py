"""A frame sensor on a GPU is the one on a CPU: the same exposures, counts and state, to the bit.

The GPU is numba's simulator, as for event sensors: a thread for each value, so pictures are small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from against.clips import OF_FRAMES
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.kernels.cuda.memory import Simulated
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_on_card import CisOnCard
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.stream.exposures import Exposure
from vid2ev.stream.frames import Frame

from .card_memories import Tensors, memories

pytestmark = pytest.mark.long

SIZE = (9, 5)
SEED = 2**64 - 1


def clip(n: int, seed: int, colour: bool, dtype: Any = np.float32) -> list[Frame]:
    """Frames of random light at uneven times, a third of it dark, some of it no light; one is a cut."""
    rng = np.random.default_rng(seed)
    t_ns = np.cumsum(rng.integers(1, 9_000_000, n))
    light = rng.random((n, SIZE[1], SIZE[0], *((3,) if colour else ()))).astype(dtype)
    light *= rng.choice([0.002, 1.0, 1.5], light.shape)
    light[rng.random(light.shape) < 0.01] = np.nan
    light[rng.random(light.shape) < 0.01] = -1.0
    light[rng.random(light.shape) < 0.01] = np.inf
    return [Frame(light[k], int(t_ns[k]), cut=k == 3) for k in range(n)]


def assert_same(one: list[Exposure], other: list[Exposure]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert (a.index, a.start_ns, a.end_ns) == (b.index, b.start_ns, b.end_ns)
        assert b.codes.dtype == np.uint16
        np.testing.assert_array_equal(a.codes, b.codes)
        np.testing.assert_array_equal(a.light, b.light)  # (None where it is not asked for)


def assert_same_state(one: Cis, other: Cis) -> None:
    ours, theirs = one.state(), other.state()
    assert ours.keys() == theirs.keys() and one.counts == other.counts
    for name, plane in ours.items():
        np.testing.assert_array_equal(plane, theirs[name], name)


def both(spec: CisSpec, memory: Any, linear: bool = False) -> tuple[Cis, CisOnCard]:
    return Cis(spec, SIZE, SEED, camera=9, linear=linear), CisOnCard(
        spec, SIZE, SEED, camera=9, linear=linear, memory=memory
    )


@settings(max_examples=8)
@given(st.data())
def test_exposures_counts_and_state_are_those_of_the_sensor_on_a_cpu(data: st.DataObject) -> None:
    on = data.draw(st.sets(st.sampled_from(sorted(OF_FRAMES))))
    more = {"colour": data.draw(st.booleans()), "blur": data.draw(st.booleans()), "noise_lsb": 5.2 * ("dsnu" in on)}
    spec = CisSpec(
        frame_rate_hz=data.draw(st.sampled_from([70.0, 200.0])), **more, **{key: OF_FRAMES[key] for key in on}
    )
    memory = data.draw(st.sampled_from([Simulated(), Tensors()]))
    cpu, card = both(spec, memory, linear=data.draw(st.booleans()))
    frames = clip(6, data.draw(st.integers(0, 99)), spec.colour, data.draw(st.sampled_from([np.float32, np.float64])))
    for frame in frames:
        assert_same(cpu.see(frame), card.see(frame))
    assert_same_state(cpu, card)
    for name, plane in cpu.maps().items():
        np.testing.assert_array_equal(plane, card.maps()[name])


def test_a_state_is_taken_up_by_the_other() -> None:
    spec, frames = CisSpec(frame_rate_hz=150.0, **OF_FRAMES), clip(12, 1, True)
    whole = list(Cis(spec, SIZE, SEED, camera=9).run(frames))
    (cpu, card), (here, there) = both(spec, Tensors()), both(spec, Tensors())
    for frame in frames[:6]:
        assert_same(here.see(frame), there.see(frame))
    cpu.restore(there.state())
    card.restore(here.state())
    ours, theirs = list(cpu.run(frames[6:])), list(card.run(frames[6:]))
    assert_same(ours, theirs)
    assert_same(ours, whole[-len(ours) :])
    assert len(ours) >= 2 and cpu.counts == card.counts
    assert here.state()["open"].size > 0, "exposures were open when the state was taken"
    card.restore({})
    assert_same(list(card.run(frames)), whole)


def test_light_may_be_tensors_and_exposures_are_kept() -> None:
    """What is read out later does not change what was before, though the device's memory is used again."""
    spec, frames = CisSpec(frame_rate_hz=300.0, exposure_us=2000), clip(8, 2, True)
    cpu, card = both(spec, Tensors())
    made = [each for frame in frames for each in card.step(torch.from_numpy(frame.light), frame.t_ns, cut=frame.cut)]
    assert len(made) > 3
    assert_same([each for frame in frames for each in cpu.see(frame)], made)


@memories
def test_what_cannot_be_is_said(memory: Any) -> None:
    card = both(CisSpec(), memory)[1]
    for light in (np.zeros((3, 3), np.float32), torch.zeros(3, 3)):
        with pytest.raises(UsageError, match=r"light of shape \(3, 3\): expected \(5, 9, 3\) .* colour='rgb'"):
            card.step(light, 0)
    for codes in (np.zeros((5, 9, 3), np.uint8), torch.zeros(5, 9, 3, dtype=torch.uint8)):
        with pytest.raises(UsageError, match=r"light of type .*uint8: expected floating point"):
            card.step(codes, 0)
    with pytest.raises(UsageError, match="another sensor's state"):
        other = Cis(CisSpec(), (3, 3))
        other.step(np.zeros((3, 3, 3)), 0)
        card.restore(other.state())
