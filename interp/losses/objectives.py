"""What each network is trained on: terms with their weights, for codes from 0 to 1.

    Super SloMo, SloMoEvents   204 L1 + 102 warps + 0.005 features + smoothness of flows
    flow                       10 L1 of flows [px] + 102 warps + smoothness of flows, as of Super SloMo
    RRIN, RRINEvents, RRINSloMoEvents         Charbonnier
    Time Lens                  L1 + 0.1 features
    rrin_events_light          Charbonnier + 0.5 of the blend of warps + 0.25 of both warps, which fades + 0.1 pyramid
    rrin_light, rrin_events_guided, RRINSloMoEvents that is guided    0.1 log error
    E2VID, FireNet             L1 + features from the second image on; FireNet + 2 inconsistency
    HDR                        100 inconsistency, from image to image and to the first + 10 features + 100 L1
                               + 3 log error of what is beyond the range of the frames

Each gives its terms weighted, so that their sum is the loss and each can be looked at.

Sources: Super SloMo's weights, which its paper gives for codes to 255 (0.8, 0.4, 0.005, 1),
https://github.com/avinashpaliwal/Super-SloMo, of features at relu4_3 in place of its conv4_3; E2VID's and FireNet's,
https://github.com/TimoStoff/event_cnn_minimal; HDR's of time and features, Lai et al. (2018), and of L1 as much as of
time.
"""

from __future__ import annotations

from collections.abc import Callable

import torch

from interp.losses.over_time import check_codes, inconsistency, visibility
from interp.losses.terms import absolute, between_frames, charbonnier, log_error, pyramid, smoothness
from interp.networks.frame_fed import Interpolated

Terms = dict[str, torch.Tensor]
Features = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
WARPS_FADE = 0.2  # share of training after which warps are not looked at any more


def super_slomo(
    made: Interpolated, frame_0: torch.Tensor, frame_1: torch.Tensor, truth: torch.Tensor, features: Features
) -> Terms:
    """Terms for images of two frames [B, C, H, W]; truth [B, N, C, H, W], features squared (`Perceptual`)."""
    return {
        "image": 204 * absolute(made.images, truth),
        "features": 0.005 * features(made.images, truth),
    } | carried(made, frame_0, frame_1, truth)


def flows(
    made: Interpolated, frame_0: torch.Tensor, frame_1: torch.Tensor, truth: torch.Tensor, flow: torch.Tensor
) -> Terms:
    """Terms for flows alone; `flow` [B, 4, H, W] px is nearly right, and says where to look: what pictures say of large
    motion has no slope that leads there."""
    assert made.flows is not None
    return {"flows": 10 * absolute(made.flows, flow)} | carried(made, frame_0, frame_1, truth)


def carried(made: Interpolated, frame_0: torch.Tensor, frame_1: torch.Tensor, truth: torch.Tensor) -> Terms:
    """Terms for the flows of two frames [B, C, H, W], by what they carry where, before they are refined; truth
    [B, N, C, H, W]."""
    assert made.flows is not None
    by_first = made.warps if made.before is None else made.before
    warps = 2 * absolute(by_first, truth[:, :, None]) + between_frames(made.flows, frame_0, frame_1)
    return {
        "warps": 102 * warps,
        "smoothness": smoothness(made.flows[:, :2]) + smoothness(made.flows[:, 2:]),
    }


def residue(made: Interpolated, truth: torch.Tensor) -> Terms:
    """The term of RRIN and those that came from it; truth [B, N, C, H, W]."""
    return {"image": charbonnier(made.images, truth)}


def supervised_residue(made: Interpolated, truth: torch.Tensor, progress: float = 0.0) -> Terms:
    """Terms for networks with a candidate, whose warps would learn nothing from the image alone.

    progress   of training, 0 ... 1
    """
    return {
        "image": charbonnier(made.images, truth),
        "blend": 0.5 * charbonnier(made.blend, truth),
        "warps": 0.25 * max(0.0, 1 - progress / WARPS_FADE) * charbonnier(made.warps, truth[:, :, None]),
        "pyramid": 0.1 * pyramid(made.images, truth),
    }


def by_ratio(made: Interpolated, truth: torch.Tensor) -> Terms:
    """The term for a network that starts from images that are nearly right, and flows that need no help: of sums of
    differences, those of the hardest pictures would decide, at the cost of the rest; truth [B, N, C, H, W]."""
    return {"image": 0.1 * log_error(made.images, truth)}


def time_lens(made: Interpolated, truth: torch.Tensor, features: Features) -> Terms:
    """Terms of Time Lens, trained as a whole; truth [B, N, C, H, W]."""
    return {"image": absolute(made.images, truth), "features": 0.1 * features(made.images, truth)}


def reconstruction(
    images: torch.Tensor, truth: torch.Tensor, features: Features, flows: torch.Tensor | None = None
) -> Terms:
    """Terms for images [B, T, 1, H, W] from events alone; the first has seen too few to count.

    flows   [B, T - 1, 2, H, W] px, from each image but the first to the one before: for what flickers
    """
    terms = {"image": absolute(images[:, 1:], truth[:, 1:]), "features": features(images[:, 1:], truth[:, 1:])}
    if flows is not None:
        terms["time"] = 2 * _flicker(images, truth, flows, through_earlier=True)
    return terms


def hdr(
    images: torch.Tensor,
    truth: torch.Tensor,
    flows: torch.Tensor,
    flows_to_first: torch.Tensor,
    features: Features,
    beyond: torch.Tensor,
) -> Terms:
    """Terms for images [B, T, C, H, W] after HDR post-processing.

    beyond           [B, T, C, H, W] whether the truth is beyond the range of the frames; L1 alone would let what is
                     seen decide, and take what is not for its median
    flows            [B, T - 1, 2, H, W] px, from each image but the first to the one before
    flows_to_first   [B, T - 1, 2, H, W] px, from each to the first; those from the third image on count
    """
    far = [
        inconsistency(images[:, k], images[:, 0], flow, visibility(truth[:, k], truth[:, 0], flow))
        for k, flow in enumerate(flows_to_first.unbind(1), 1)
        if k >= 2
    ]
    return {
        "image": 100 * absolute(images, truth),
        "time": 100 * _flicker(images, truth, flows, through_earlier=False),
        "long time": 100 * torch.stack(far).mean() if far else images.new_zeros(()),
        "features": 10 * features(images, truth),
        "beyond": 3 * log_error(images, truth, beyond),
    }


def _flicker(images: torch.Tensor, truth: torch.Tensor, flows: torch.Tensor, through_earlier: bool) -> torch.Tensor:
    """Mean inconsistency of each image with the one before.  Raises UsageError for codes that are not from 0 to 1."""
    check_codes(truth)
    found = [
        inconsistency(
            images[:, k], images[:, k - 1], flow, visibility(truth[:, k], truth[:, k - 1], flow), through_earlier
        )
        for k, flow in enumerate(flows.unbind(1), 1)
    ]
    return torch.stack(found).mean()
