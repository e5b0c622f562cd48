"""States as they come back from a disk: arrays of the kind that they were, events that a sensor can have sent."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import BaseModel

from vid2ev.errors import UsageError
from vid2ev.stream.events import Events

LATEST_NS = 1 << 63  # as of frames (`sensors.limits.time_ns`)
MARK = "of"


def entry(state: Mapping[str, np.ndarray], name: str, dtype: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """An array of a state, of this type and shape; None is any length.  Raises UsageError for another one, or none."""
    if name not in state:
        raise UsageError(f"state without '{name}': another sensor's state")
    array = np.asarray(state[name])
    fits = len(array.shape) == len(shape) and all(b in (None, a) for a, b in zip(array.shape, shape, strict=True))
    if array.dtype != np.dtype(dtype) or not fits:
        raise UsageError(
            f"state of {array.dtype} {list(array.shape)} in '{name}', expected {np.dtype(dtype)}"
            f" {[length or 'any' for length in shape]}: another sensor's state"
        )
    return array


def mark_of(spec: BaseModel, size: tuple[int, int], seed: int, camera: int) -> dict[str, np.ndarray]:
    """What a state says of the sensor that gave it: uint8 [16], another for every other sensor."""
    said = repr((spec.model_dump_json(), *map(int, (*size, seed, camera)))).encode()
    return {MARK: np.frombuffer(hashlib.blake2b(said, digest_size=16).digest(), np.uint8).copy()}


def check_mark(state: Mapping[str, np.ndarray], mark: Mapping[str, np.ndarray]) -> None:
    """Raise UsageError for a state of a sensor with another mark."""
    if not np.array_equal(entry(state, MARK, np.uint8, mark[MARK].shape), mark[MARK]):
        raise UsageError(
            "another sensor's state, which has other parameters, or another size, seed or camera; expected its own"
        )


def clock(state: Mapping[str, np.ndarray], name: str, count: int) -> tuple[int, ...]:
    """The whole numbers [int64] of a state, which are times or counts.  Raises UsageError."""
    numbers = tuple(int(number) for number in entry(state, name, np.int64, (count,)))
    if any(abs(number) >= LATEST_NS for number in numbers):
        raise UsageError(f"state with {max(numbers, key=abs)} in '{name}': no time can be that late")
    return numbers


def events_of(
    state: Mapping[str, np.ndarray], prefix: str, size: tuple[int, int], labels: bool, dtypes: Mapping[str, Any]
) -> Events:
    """Events of a state, in order of time and within a sensor of `size`.  Raises UsageError."""
    held = {name: entry(state, f"{prefix}{name}", dtype, (None,)) for name, dtype in dtypes.items()}
    t, x, y, p = (held[name] for name in "txyp")
    label = held["label"] if labels else None
    if any(len(array) != len(t) for array in (x, y, p, t if label is None else label)):
        raise UsageError(f"state with arrays '{prefix}...' that differ in length: another sensor's state")
    within = all(np.all((values >= 0) & (values < most)) for values, most in ((x, size[0]), (y, size[1]), (p, 2)))
    if not within or np.any(t[1:] < t[:-1]) or np.any((t < -LATEST_NS) | (t > LATEST_NS)):
        raise UsageError(f"state with events '{prefix}...' that no sensor of {size[0]}x{size[1]} pixels sends")
    if label is not None:
        label = label.astype(np.uint8)
    return Events(t.astype(np.int64), x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8), label)
