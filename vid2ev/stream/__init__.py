"""What flows: frames of linear light, and events, both on one clock."""

from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame

__all__ = ["Events", "Frame"]
