"""The one way into networks that take two frames: any size, any number of targets, the first flow once per pair.

    network(frame_0, frame_1, times, events) -> Interpolated

is `network.at(network.prepare(frame_0, frame_1, events), times)`.  What does not depend on the target is in
`prepare`, so that a pair can be asked for more targets later.

Sides need not be multiples of anything: frames are continued by their borders, events by none, and what comes out is
cut back.  Nothing is resampled.  Codes are not clipped: that would take the gradients from pixels out of range.

A network of three colours takes grey frames, as three that are alike, and gives back their mean.  One of one colour
takes the luminance of frames that have colours, as a grey camera would have seen it, and what it makes comes in the
colours of these, carried and blended as it does with luminance: events tell nothing else.  (Plane by plane, as if each
were luminance, the closed form `guided` had 32.2 dB on 8 clips x8; so it has 34.9, as much as with three colours.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import torch
from torch import nn
from torch.nn import functional as F

from interp.blend import blend
from interp.candidates.guided import motion_between, recoloured
from interp.light import Transfer, grey
from interp.networks.around import Around
from interp.networks.spec import FrameFedSpec
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts
from interp.warp import both_warped
from vid2ev.errors import UsageError

Times = torch.Tensor | Sequence[float]
LEAST = 1e-6  # weight of a picture of which colours are taken
FLOATS = (torch.float32, torch.float16, torch.bfloat16)


@dataclass(frozen=True, slots=True)
class Pair:
    """B pairs of frames, ready for any number of targets.

    frame_0, frame_1   [B, C, H, W], with colours and sides that the network takes
    events             of that size; none if `seen` is false
    flows              [B, 4, H, W] px: from the first to the second (x, y) and back; at the network's own resolution
    once               what else the network computes once
    size, grey         height and width, and whether the frames were grey, as they came
    around             the whole frames, where these are parts of them
    coloured           both frames in their colours [B, 3, H, W], where the network takes luminance alone
    """

    frame_0: torch.Tensor
    frame_1: torch.Tensor
    events: EventCounts
    seen: bool
    size: tuple[int, int]
    grey: bool
    flows: torch.Tensor | None = None
    once: tuple[torch.Tensor, ...] = ()
    around: Around | None = None
    coloured: tuple[torch.Tensor, ...] = ()


@dataclass(frozen=True, slots=True)
class Interpolated:
    """N images for each of B pairs, and what they were made of, for losses.

    images     [B, N, C, H, W] codes, not clipped
    flows      [B, 4, H, W] px: first to second frame (x, y), second to first; None of networks that do not estimate it
    flows_at   [B, N, 4, H, W] px: target to first frame, target to second
    warps      [B, N, 2, C, H, W]: both frames, warped by these
    weights    [B, N, K, H, W] of the pictures blended, the two warps first
    blend      [B, N, C, H, W]: of the two warps alone
    before     like warps, by the flows before they were refined; None of networks that do not refine them; luminance
               where the network takes that alone
    """

    images: torch.Tensor
    flows: torch.Tensor | None
    flows_at: torch.Tensor
    warps: torch.Tensor
    weights: torch.Tensor
    blend: torch.Tensor
    before: torch.Tensor | None = None


class FrameFed(nn.Module):
    """Base of the networks that take two frames.  They add `synthesise`, `multiple`, and what there is once per
    pair."""

    spec: FrameFedSpec
    multiple: int

    @property
    def seeks_motion(self) -> bool:
        """Whether it takes the motion between the frames by DIS."""
        return False

    @property
    def transfer(self) -> Transfer:
        """How the frames are coded."""
        return getattr(self.spec, "transfer", "srgb")

    def flows_of(self, pair: Pair) -> torch.Tensor | None:
        """Flows between the frames, [B, 4, h, w] px."""
        return None

    def computed_once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """What else does not depend on the target."""
        return ()

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        raise NotImplementedError

    def forward(
        self, frame_0: torch.Tensor, frame_1: torch.Tensor, times: Times, events: EventCounts | None = None
    ) -> Interpolated:
        """Images at N times.

        frame_0, frame_1   [B, C, H, W] codes, 0 ... 1; C is 1 or 3, whichever the network has
        times              [N] or [B, N], 0 ... 1 from the first frame to the second
        events             between the frames; those of a sensor of another size are laid over the frames edge on edge
        Raises UsageError for types, shapes and times that cannot be meant.
        """
        return self.at(self.prepare(frame_0, frame_1, events), times)

    def prepare(
        self,
        frame_0: torch.Tensor,
        frame_1: torch.Tensor,
        events: EventCounts | None = None,
        around: Around | None = None,
    ) -> Pair:
        """What does not depend on the targets; see `forward`.  `around` is what parts of frames know of the whole."""
        pair = self.padded(frame_0, frame_1, events)
        if around is not None:
            pair = replace(pair, around=around.of_part(pair.frame_0.shape[-2:]))
        pair = replace(pair, flows=self.flows_of(pair))
        return replace(pair, once=self.computed_once(pair))

    def at(self, pair: Pair, times: Times) -> Interpolated:
        """Images of a pair at N times; see `forward`."""
        try:
            asked = torch.as_tensor(times, dtype=torch.float32, device=pair.frame_0.device)
        except (TypeError, ValueError) as error:
            raise UsageError(f"times {times!r}: expected numbers, 0 ... 1") from error
        if asked.ndim not in (1, 2) or not asked.numel() or (asked.ndim == 2 and len(asked) != len(pair.frame_0)):
            raise UsageError(
                f"times of shape {list(asked.shape)}: expected [N], or [B, N] for {len(pair.frame_0)} pairs"
            )
        if not bool(((asked >= 0) & (asked <= 1)).all()):
            raise UsageError(
                "times outside of 0 ... 1, the first and the second frame; choose frames around the target"
            )
        asked = asked if asked.ndim == 2 else asked.expand(len(pair.frame_0), -1)
        made = self.synthesise(pair, asked)
        return _cut_back(_in_colours(made, pair, asked, self.transfer) if pair.coloured else made, pair)

    def padded(self, frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts | None = None) -> Pair:
        """A pair that nothing is computed of yet; see `forward`."""
        self._check(frame_0, frame_1, events)
        batch, channels, height, width = frame_0.shape
        right, below = -width % self.multiple, -height % self.multiple
        seen, colours = events is not None, self.spec.colours
        if events is None:
            events = EventCounts.none(batch, (height, width)).to(frame_0.device)
        whole = [F.pad(frame.float(), (0, right, 0, below), mode="replicate") for frame in (frame_0, frame_1)]
        coloured = tuple(whole) if channels > colours else ()
        first, second = (
            grey(frame, self.transfer) if coloured else frame.expand(-1, colours, -1, -1) for frame in whole
        )
        laid = over(events, (height, width)).padded(right, below)
        return Pair(first, second, laid, seen, (height, width), channels < colours, coloured=coloured)

    def _check(self, frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts | None) -> None:
        for frame in (frame_0, frame_1):
            if not isinstance(frame, torch.Tensor) or frame.dtype not in FLOATS:
                kind = frame.dtype if isinstance(frame, torch.Tensor) else type(frame).__name__
                raise UsageError(f"frames of {kind}: expected tensors of codes, 0 ... 1, in float32 or 16 bits")
        if events is not None and not isinstance(events, EventCounts):
            raise UsageError(f"events of type {type(events).__name__}: expected EventCounts, as of `count_events`")
        if frame_0.ndim != 4 or frame_0.shape != frame_1.shape or frame_0.shape[1] not in (1, 3):
            shapes = f"{list(frame_0.shape)} and {list(frame_1.shape)}"
            raise UsageError(f"frames of shapes {shapes}: expected two [B, C, H, W] that are alike, C 3 or 1")
        if events is not None and len(events.off_on) != len(frame_0):
            raise UsageError(
                f"events of {len(events.off_on)} pairs and {len(frame_0)} pairs of frames; stack one for each"
            )


def joined(batches: Sequence[Interpolated], order: torch.Tensor) -> Interpolated:
    """One batch of several, in another order."""

    def of_all(name: str) -> torch.Tensor | None:
        each = [getattr(batch, name) for batch in batches]
        return None if each[0] is None else torch.cat(each)[order]

    return Interpolated(**{field.name: of_all(field.name) for field in fields(Interpolated)})  # type: ignore[arg-type]


def run(network: nn.Module, parts: Sequence[torch.Tensor]) -> torch.Tensor:
    """A network's answer [B, N, c, H, W] float32 to parts [B, N, c_k, H, W], or [B, c_k, H, W] if alike for all N.

    Masks that are sure of themselves are beyond what float16 holds: then it is asked once more, in float32.
    """
    targets = max(part.shape[1] for part in parts if part.ndim == 5)
    wide = [part if part.ndim == 5 else part[:, None].expand(-1, targets, -1, -1, -1) for part in parts]
    joined = torch.cat([part.float() for part in wide], 2)
    found = network(joined.flatten(0, 1))
    if found.dtype == torch.float16 and not bool(torch.isfinite(found).all()):
        with torch.autocast(joined.device.type, enabled=False):
            found = network(joined.flatten(0, 1))
    return found.float().unflatten(0, joined.shape[:2])


def warped(pair: Pair, flows_at: torch.Tensor, *, cubic: bool = False) -> torch.Tensor:
    """Both frames, warped by flows [B, N, 4, H, W] to them: [B, N, 2, C, H, W]."""
    whole = pair.around or pair
    return _carried((whole.frame_0, whole.frame_1), pair, flows_at, cubic)


def sought(pair: Pair, transfer: Transfer) -> torch.Tensor:
    """Motion between the frames by DIS, [B, 4, H, W] px."""
    if pair.around is not None and pair.around.between is not None:
        return pair.around.between
    return motion_between(pair.frame_0, pair.frame_1, transfer)


def shares_at(times: torch.Tensor) -> torch.Tensor:
    """How near both frames are: [B, N, 2] of times [B, N]."""
    return torch.stack([1 - times, times], -1)


def _carried(frames: tuple[torch.Tensor, ...], pair: Pair, flows_at: torch.Tensor, cubic: bool = False) -> torch.Tensor:
    """Two whole frames, warped to a pair, or to the part of them that it is."""
    first, second = frames
    return both_warped(first, second, flows_at, None if pair.around is None else pair.around.corner, cubic=cubic)


def _in_colours(made: Interpolated, pair: Pair, times: torch.Tensor, transfer: Transfer) -> Interpolated:
    """What a network made of luminance, in the colours of both frames, carried and blended as there."""
    warps = _carried((pair.around or pair).coloured, pair, made.flows_at)
    logits = made.weights[:, :, :2].clamp(min=LEAST).log()
    colours, _ = blend(warps, logits, times.new_ones(*times.shape, 2))
    return replace(made, images=recoloured(made.images, colours, transfer), warps=warps, blend=colours)


def _cut_back(made: Interpolated, pair: Pair) -> Interpolated:
    height, width = pair.size

    def cut(part: torch.Tensor) -> torch.Tensor:
        return part[..., :height, :width]

    def codes(part: torch.Tensor) -> torch.Tensor:
        return cut(part).mean(-3, keepdim=True) if pair.grey else cut(part)

    return Interpolated(
        codes(made.images),
        None if made.flows is None else cut(made.flows),
        cut(made.flows_at),
        codes(made.warps),
        cut(made.weights),
        codes(made.blend),
        None if made.before is None else codes(made.before),
    )
