"""Small clips that hypothesis draws: any light, at any times, cut anywhere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

SIZE = (7, 5)


class Clip(NamedTuple):
    """Frames of light or codes [F, H, W] at `t_ns`, to be cut before the frame `cut`, in a sensor of a seed."""

    t_ns: np.ndarray
    frames: np.ndarray
    cut: int
    seed: int


exponents = st.floats(-4, 2)
lights = st.one_of(st.just(0.0), st.just(1.0), exponents.map(lambda e: 10.0**e))
odd = st.sampled_from([np.nan, np.inf, -1.0, 1e30, 1e-40])


@st.composite
def clips(draw: st.DrawFn, dtype: np.dtype) -> Clip:
    """Up to eight frames, 1 ns to 0.1 s apart: some pixels jump, some stay, some are no light at all."""
    count, seed = draw(st.integers(2, 8)), draw(st.integers(0, 2**64 - 1))
    steps = draw(st.lists(st.floats(0, 8).map(lambda e: int(10**e)), min_size=count - 1, max_size=count - 1))
    t_ns = draw(st.integers(0, 10**15)) + np.concatenate([[0], np.cumsum(steps, dtype=np.int64)])
    rng, levels = np.random.default_rng(seed), np.array(draw(st.lists(lights, min_size=6, max_size=6)))
    which = rng.integers(0, len(levels), (count, *SIZE[::-1]))
    still = rng.random((count, *SIZE[::-1])) < draw(st.sampled_from([0.0, 0.3, 0.9]))
    for k in range(1, count):
        which[k] = np.where(still[k], which[k - 1], which[k])
    frames = levels[which]
    if dtype.kind == "u":
        top = np.iinfo(dtype).max
        return Clip(t_ns, np.clip(frames * top, 0, top).astype(dtype), draw(st.integers(1, count)), seed)
    if draw(st.booleans()):
        frames[rng.random(frames.shape) < 0.05] = draw(odd)
    return Clip(t_ns, frames.astype(dtype), draw(st.integers(1, count)), seed)
