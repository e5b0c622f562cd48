"""What flows: frames of linear light, events, and exposures, all on one clock."""

from vid2ev.stream.events import Events
from vid2ev.stream.exposures import Exposure
from vid2ev.stream.frames import Frame

__all__ = ["Events", "Exposure", "Frame"]
