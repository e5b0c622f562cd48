"""What rebuilds the frames between two frames: by name, or with the weights of a file.

    method = open_method("bridge").begin()
    images = method.between(gap, times)

is all that evaluation and interpolation know of any of them.  A new method is a class that satisfies `Method`, and a
line in `METHODS`.

    nearest       the nearer key frame
    linear        a blend of the codes of both
    flow          light carried along the motion between both: DIS, forwards and backwards
    integration   events integrated from the nearer key frame
    both          events integrated from both, with weights 1 - t and t: the complementary filter
    bridge        the same with the drift spread in proportion to events: the closed form to beat
    ramps         the bridge with light on its way between events, instead of in stairs
    guided        the key frames carried to where the light of the ramps is, or along the motion between them where that
                  is nearer, and mixed with the ramps as either is in doubt
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import torch

from interp.candidates.bridge import bridge
from interp.candidates.ramps import ramps
from interp.methods.closed_forms import ClosedForm, flow, guided_by_ramps, linear, nearest, of_events
from interp.methods.gap import Gap, Method
from interp.methods.of_networks import of_weights
from interp.methods.running import PLAIN, Running
from vid2ev.errors import UsageError
from vid2ev.errors import nearest as near

__all__ = ["METHODS", "Gap", "Method", "open_method"]

METHODS: dict[str, Callable[[], Method]] = {
    "nearest": lambda: ClosedForm("nearest", nearest, needs_events=False),
    "linear": lambda: ClosedForm("linear", linear, needs_events=False),
    "flow": lambda: ClosedForm("flow", flow, needs_events=False),
    "integration": lambda: ClosedForm("integration", of_events(partial(bridge, method="nearest"))),
    "both": lambda: ClosedForm("both", of_events(partial(bridge, method="both"))),
    "bridge": lambda: ClosedForm("bridge", of_events(bridge)),
    "ramps": lambda: ClosedForm("ramps", of_events(ramps)),
    "guided": lambda: ClosedForm("guided", guided_by_ramps, in_tiles=True),
}


def open_method(name: str, device: torch.device | str = "cpu", running: Running = PLAIN) -> Method:
    """The method of a name, or of a file of weights, which is run as `running` says.

    Raises UsageError for a name that is none, and for a way to run what is no network; DataError for a file that holds
    no network which rebuilds frames.
    """
    name = str(name)
    if name in METHODS:
        if running != PLAIN:
            raise UsageError(f"method '{name}' is no network: leave out --precision and --compile, which are of these")
        return METHODS[name]()
    if Path(name).suffix == ".safetensors" or os.path.exists(name):  # (Path.exists raises for names that are too long)
        return of_weights(Path(name), device, running=running)
    known = ", ".join(METHODS)
    raise UsageError(f"method '{name}'{near(name, METHODS)}: expected one of {known}, or a file of weights")
