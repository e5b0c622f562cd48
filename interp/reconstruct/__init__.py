"""Pictures from events alone: `reconstruct(events, output)`.

events -> slices (by time, or so many events) -> a filter or a network, which remembers -> pictures
"""

from interp.reconstruct.whole import reconstruct as reconstruct

__all__ = ["reconstruct"]
