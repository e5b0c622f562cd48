"""What rebuilding frames costs in time, and what it is worth: `vid2ev cost SOURCE --rebuild N`."""
