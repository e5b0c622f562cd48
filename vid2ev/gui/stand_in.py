"""Sensors that stand in for others while these would have to be compiled: what is off is on, but too slight to be seen.

The pixels of an event camera are compiled for the effects that are on, which takes ten seconds to a minute for each
combination.  A sensor in which a leak of 1e-9 Hz takes the place of none has the same events (but for one in a million,
perhaps), and one kernel for many sensors: whether a person sets a leak, crossing noise or hot pixels, it is there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from threading import Thread
from typing import Any

import numpy as np

from vid2ev.kernels.layout import Flags
from vid2ev.sensors.compiled import flags_of
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.presets import DVS, load
from vid2ev.sensors.spec import DvsSpec

SIZE, FRAMES = (16, 16), 3  # of what is seen so that it is compiled
SLIGHT = {"crossing_noise": 1e-9, "refractory_us": 1e-4, "shot_rate_hz": 1e-12}  # (no nanosecond: events may share one)
LEAK = {"leak_rate_hz": 1e-9}  # (for itself: it has most sensors take a slower way)


class Kernels:
    """The kernels that a process has, and those that it compiles, each in a thread."""

    def __init__(self) -> None:
        self._coming: dict[Flags, Thread] = {}

    def choose(self, spec: DvsSpec, ready: frozenset[Flags]) -> DvsSpec:
        """The sensor, or one that stands in for it where that saves compiling; `ready` are kernels on disk."""
        known = ready | {flags for flags, thread in self._coming.items() if not thread.is_alive()}
        return next((one for one in (spec, *stand_ins(spec)) if flags_of(one, False) in known), spec)

    def there(self, spec: DvsSpec, patience_s: float) -> bool:
        """Whether the kernel of a sensor is there within so long; what is not goes on being compiled."""
        flags = flags_of(spec, False)
        if flags not in self._coming:
            self._coming[flags] = Thread(target=see_something, args=(spec,), daemon=True)
            self._coming[flags].start()
        self._coming[flags].join(patience_s)
        return not self._coming[flags].is_alive()


def see_something(spec: DvsSpec) -> None:
    """Have the sensor see a few frames, by which all that it needs is compiled, or read from disk."""
    light = np.linspace(0.1, 1.0, SIZE[0] * SIZE[1], dtype=np.float32).reshape(SIZE)
    dvs = Dvs(spec, SIZE)
    for k in range(FRAMES):
        dvs.step(light * (k + 1), 1_000_000 * k)
    dvs.inside(np.zeros(1, np.int64))


def stand_ins(spec: DvsSpec) -> Iterator[DvsSpec]:
    """The sensors that may stand in for one, the quickest first."""
    yield with_slight(spec, SLIGHT)
    yield with_slight(spec, SLIGHT | LEAK)


def with_slight(spec: DvsSpec, slight: Mapping[str, object]) -> DvsSpec:
    """The sensor with the slightest values of what is off."""
    return spec.model_copy(update={key: value for key, value in slight.items() if not getattr(spec, key)})


def usual() -> list[DvsSpec]:
    """Sensors that stand in for all presets, and for what most people change of them; each with a kernel of its own."""
    presets: list[Any] = [load(DVS, name) for name in DVS.names()]
    specs = [one for preset in presets for one in stand_ins(preset)]
    return [*{flags_of(one, False): one for one in specs}.values()]
