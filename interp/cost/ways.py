"""The ways to rebuild frames that are compared.

closed forms    all of `interp.methods`
networks        the best that come with vid2ev, of each kind, and those that are asked for
of the first of these, or of what is asked for:
precision       fewer bits                  compiled   by torch, where it can
tiles           of 256x256 px               motion     what is found once per gap, found anew for each frame
larger          the same with more channels, untrained: its time alone
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Self

import torch

from interp import pretrained
from interp.evaluate.naming import apart
from interp.methods import METHODS, Gap, Method, open_method
from interp.methods.gap import Together
from interp.methods.of_networks import OfEvents, OfFrames, of_weights
from interp.methods.running import PLAIN, PRECISIONS, Running, compiles
from interp.methods.tiling import Tiling, tiling_for
from interp.networks.spec import BASES

KINDS = (pretrained.WITH_EVENTS, pretrained.OF_FRAMES, pretrained.OF_EVENTS)
TILE = "256x256"


@dataclass(frozen=True)
class Way:
    """A way to rebuild frames.

    name     what it is called in tables
    group    what it is (above)
    open     opens its method
    asked    what asks `interpolate` for it; empty if nothing does
    scored   whether its frames are worth a look
    """

    name: str
    group: str
    open: Callable[[], Method] = field(repr=False)
    asked: str = ""
    scored: bool = True


@dataclass(frozen=True, slots=True)
class Tiled(Together):
    """A method that makes frames in tiles."""

    method: Method
    tile: str

    name, needs_events, sequential = "tiled", True, False

    def begin(self) -> Self:
        """See `interp.methods.gap.Method`."""
        return replace(self, method=self.method.begin())

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """See `interp.methods.gap.Method`."""
        return self.method.images(gap, times, tiling_for(self.method, gap, self.tile))


@dataclass(frozen=True, slots=True)
class Anew(Together):
    """A method that is asked for one frame at a time, and does all of its work for each."""

    method: Method

    name, needs_events, sequential = "anew", True, False

    def begin(self) -> Self:
        """See `interp.methods.gap.Method`."""
        return replace(self, method=self.method.begin())

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """See `interp.methods.gap.Method`."""
        return (self.method.between(gap, time, tiling) for time in times.split(1))


def ways(networks: Sequence[str | Path], device: str) -> list[Way]:
    """All ways; of networks those that are asked for, or else those that come with vid2ev.

    Raises UsageError, DataError for weights that cannot be used.
    """
    asked = list(dict.fromkeys(networks)) or [path.stem for names in KINDS if (path := pretrained.first(names))]
    paths = [pretrained.path_of(name) for name in asked]
    names = apart([*METHODS, *map(pretrained.name_of, paths)])[len(METHODS) :]
    found = [Way(name, "closed forms", partial(open_method, name), f"--method {name}") for name in METHODS]
    known = zip(asked, paths, names, strict=True)
    opened = {f"--network {of}": of_weights(path, device, name) for of, path, name in known}
    found += [Way(plain.name, "networks", partial(_itself, plain), of) for of, plain in opened.items()]
    for of, plain in [*opened.items()][:1]:
        found += _otherwise(plain, of, device)
        if compiles(device):
            found.append(_compiled(paths[0], names[0], of, device))
    return found


def _otherwise(plain: OfFrames | OfEvents, asked: str, device: str) -> Iterator[Way]:
    """The same network, run otherwise."""
    name = plain.name
    for precision in PRECISIONS:
        running = Running(precision)
        # (16-bit floats of another kind are slow on CPUs, and no more exact than is of use)
        if running != PLAIN and not (precision == "float16" and device == "cpu"):
            coarse = partial(replace, plain, running=running)
            yield Way(f"{name}, {precision}", "precision", coarse, f"{asked} --precision {precision}")
    if not isinstance(plain, OfFrames):
        return
    yield Way(f"{name}, tiles", "tiles", lambda: Tiled(plain, TILE), f"{asked} --tile {TILE}")
    yield Way(f"{name}, motion anew", "motion", lambda: Anew(plain))
    for size in list(BASES)[list(BASES).index(plain.network.spec.size) + 1 :]:
        yield Way(f"{name}, of size {size}", "larger", partial(_untrained, plain, size), scored=False)


def _compiled(path: Path, name: str, asked: str, device: str) -> Way:
    """The same network compiled: loaded once more, as it is compiled in place."""
    opened = partial(of_weights, path, device, running=Running(compiled=True))
    return Way(f"{name}, compiled", "compiled", opened, f"{asked} --compile")


def _itself(method: Method) -> Method:
    return method


def _untrained(method: OfFrames, size: str) -> Method:
    network = type(method.network)(method.network.spec.model_copy(update={"size": size}))  # type: ignore[call-arg]
    return replace(method, network=network.to(next(method.network.parameters()).device).eval())
