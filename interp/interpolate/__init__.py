"""High-frame-rate video from recordings and videos: `interpolate(source, output, multiple=32)`.

take -> stretches (from key frame to key frame; cuts) -> fill (a method, tile by tile) -> pictures -> shelf
"""
