"""interp: high-frame-rate video from slow frames and events.

A client of vid2ev's public names; vid2ev knows nothing of it.  `interp.networks.make` makes the networks, and README.md
shows the house.
"""
