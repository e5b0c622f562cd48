"""Events of a camera that stands elsewhere, brought to where the frames have seen the same change.

    d(x) = ln Y1 - ln Y0       between the key frames, of light over a pixel of the event camera
    E(x) = c_ON n_ON - c_OFF n_OFF       of all events between them, laid over the frames: as calibration says, for what
                                         is far away or on a plane, or edge on edge
    F    = DIS(d -> E)         counts at x are those at x + F(x)

Both pictures are of one and the same change, so how far they are apart is what the cameras are apart, pixel by pixel,
or what calibration without depth leaves of it.  Motion between the frames does not count: both are of the whole gap.  F
is taken where it makes the pictures agree better than they do already, by two codes of 255, of which 127 are as much as
nearly all pixels change; and only if it explains, over the picture, three tenths of the variance that is not explained
without: noise is matched with noise somewhere, always.  (Of sensors 15 mm beside it explained 0.7 to 0.8, of sensors in
the same place 0.02 to 0.17.)

Measured with a sensor of 9 pixels of the frame per pixel, 15 mm beside it, near things (disparity 7.6 px in the mean,
more than 20 at the most), x8, the bridge: 28.6 dB edge on edge, 29.9 brought, for 30.0 of a sensor in the same place;
in three such scenes together 29.77 for 29.86.  Nothing is gained by it for a sensor that is in the same place.  Beside
a camera that is turned by 6 degrees, too, and sees 52 degrees of the frames' 60, calibration is what counts: in two
scenes at 320x240 22.8 and 23.6 dB without, 24.5 and 24.7 with it, for 26.5 and 26.9 in the same place and way.  Maps of
what each pixel sees at an instant are no better where things move: in `parallax` 23.2 dB of middle frames, for 24.6.
"""

from __future__ import annotations

import numpy as np
import torch

from interp.candidates.bridge import DARK
from interp.candidates.guided import SMALLEST, averaged, dense_flow
from interp.light import luminance, to_light
from interp.precision import in_full_precision
from interp.representation.carried import at_places, over, places_over
from interp.representation.event_counts import EventCounts
from vid2ev.upsample.motion import carried_along, convincing

CONVINCED_CODES = 2.0
EXPLAINED = 0.3
NEARLY_ALL = 0.98  # of the pixels change by less than what 127 codes stand for
LEAST_NATS = 0.3  # that these stand for


@in_full_precision
def registered(frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts) -> EventCounts:
    """Counts [B, 2, S, h, w] between frames [B, C, H, W], and where pixels of these look at them.

    They are looked for around the places that the counts know (`at_places`), or else edge on edge.
    """
    height, width = frame_0.shape[-2:]
    if min(height, width) < SMALLEST:
        return events
    whole = over(events.summed(), (height, width))
    moved = [_moved(*pictures) for pictures in zip(_change(frame_0, frame_1, whole), _net(whole), strict=True)]
    around = events.places.where if events.places else [places_over(events, (height, width))] * len(moved)
    where = [_beyond(places, flow.to(places)) for places, flow in zip(around, moved, strict=True)]
    return at_places(events, torch.stack(where))


@in_full_precision
def unexplained(frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts) -> float:
    """Share of the change between two frames [1, C, H, W] that events, at the places that they know, do not explain."""
    whole = over(events.summed(), (frame_0.shape[-2], frame_0.shape[-1]))
    return _unexplained(_change(frame_0, frame_1, whole)[0].cpu().numpy(), _net(whole)[0].cpu().numpy())


def _beyond(places: torch.Tensor, flow: torch.Tensor) -> torch.Tensor:
    """Where pixels look that lie F [H, W, 2] px beside those of which the places [H, W, 2] are: these go on as they do
    from pixel to pixel."""
    down, across = torch.gradient(places, dim=(0, 1))
    return places + across * flow[..., :1] + down * flow[..., 1:]


def _change(frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts) -> torch.Tensor:
    """d of frames, [B, H, W] nat."""
    lights = (luminance(to_light(frame, "srgb")).clamp(min=0) for frame in (frame_0, frame_1))
    first, last = (torch.log(averaged(light, events.footprint) + DARK) for light in lights)
    return (last - first)[:, 0]


def _net(events: EventCounts) -> torch.Tensor:
    """E of counts in one sub-interval, [B, H, W] nat."""
    off, on = events.contrast[:, :, None, None].unbind(1)
    return on * events.off_on[:, 1, 0] - off * events.off_on[:, 0, 0]


def _moved(change: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
    """F [H, W, 2] px from the change of the frames to that of the events, [H, W] nat."""
    largest = max(LEAST_NATS, float(np.quantile(change.abs().cpu().numpy(), NEARLY_ALL)))
    start, end = (
        (127.5 * (1 + each / largest)).clamp(0, 255).cpu().numpy().astype(np.uint8) for each in (change, seen)
    )
    flow = convincing(dense_flow().calc(start, end, None), start, end, CONVINCED_CODES)
    explains = _unexplained(start, carried_along(end, flow)) <= (1 - EXPLAINED) * _unexplained(start, end)
    return torch.from_numpy(flow if explains else np.zeros_like(flow))


def _unexplained(change: np.ndarray, seen: np.ndarray) -> float:
    """Share of the variance of a picture that no multiple of another one explains."""
    one, other = (each - each.mean(dtype=np.float64) for each in (change, seen))
    most = (one**2).sum() * (other**2).sum()
    return 1 - float((one * other).sum() ** 2 / most) if most else 1.0
