"""High-frame-rate video from recordings and videos: `interpolate(source, output, multiple=32)`.

    take -> stretches (from key frame to key frame; cuts) -> fill (a method, tile by tile) -> after (HDR) -> pictures
    -> shelf (a folder or a film, there as a whole or not at all)

`frames` gives the frames one by one.
"""

from interp.interpolate.take import Options as Options
from interp.interpolate.whole import frames as frames
from interp.interpolate.whole import interpolate as interpolate

__all__ = ["Options", "frames", "interpolate"]
