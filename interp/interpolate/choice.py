"""Which method interpolates: the one asked for, or else the best that there is for what is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from interp import pretrained
from interp.methods import Method, open_method
from interp.methods.one_frame import WAYS, OneFrame
from interp.methods.running import PLAIN, Running
from vid2ev.errors import UsageError
from vid2ev.recording.manifest import sha256

BEST = "guided"  # of what needs no training
FALLBACK = "flow"  # where a method needs events, and there are none


@dataclass(frozen=True, slots=True)
class Choice:
    """A method, why it was chosen, and what it is, for JSON."""

    method: Method
    why: str
    about: dict[str, Any]


def choice(
    name: str | None,
    network: str | Path | None,
    events: bool,
    where: str,
    device: torch.device | str,
    running: Running = PLAIN,
) -> Choice:
    """The method of a name or a file of weights, or without either the default.

    events   whether there are events; `where` is what has them or not, for people
    running  how a network is run
    Raises UsageError for both at once, and for a method that needs events where there are none.
    """
    if name and network:
        raise UsageError(f"--method {name} and --network {network} each say what interpolates; leave out one of them")
    asked, why = f"network '{network}'" if network else f"method '{name}'", "as asked"
    network = pretrained.path_of(network) if network else None
    if not (name or network):
        # (of frames alone there is a network, too, but it does not beat optical flow)
        network = pretrained.first(pretrained.WITH_EVENTS) if events else None
        name = None if network else BEST if events else FALLBACK
        best = "the network that comes with vid2ev" if network else "the best that needs no training"
        why = f"{best}, since there are {'events' if events else 'no events'}"
    method = open_method(str(network or name), device, running)
    if method.needs_events and not events:
        raise UsageError(f"{asked} needs events, and {where} has none; choose --method {FALLBACK}, or leave it out")
    about: dict[str, Any] = {"method": method.name}
    if network:
        about |= {"weights": str(network), "sha256": sha256(network), **running.describe()}
    return Choice(method, why, about)


def choice_of_one(name: str | None, network: str | Path | None, where: str, running: Running = PLAIN) -> Choice:
    """The method for a single frame.  Raises UsageError for one that takes two, networks among them, and for a way to
    run these."""
    asked = network or name
    if network or (name and name not in WAYS):
        raise UsageError(f"method '{asked}' takes two frames, and {where} is a single one; choose {' or '.join(WAYS)}")
    if running != PLAIN:
        raise UsageError(f"{where} is a single frame, which no network takes: leave out --precision and --compile")
    method = OneFrame(name or WAYS[0])  # type: ignore[arg-type]
    return Choice(method, "as asked" if asked else "what a single frame and its events allow", {"method": method.name})


def device_of(name: str) -> torch.device:
    """cpu, cuda, or with auto the GPU if there is one.  Raises UsageError for a GPU that is not there."""
    if name not in ("cpu", "cuda", "auto"):
        raise UsageError(f"device '{name}': expected cpu, cuda or auto")
    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        raise UsageError("device cuda: no GPU that torch can use here; choose cpu or auto")
    return torch.device("cuda" if there and name != "cpu" else "cpu")
