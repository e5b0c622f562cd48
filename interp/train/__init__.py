"""Training: networks and samples in, weights and their curves out.  `vid2ev train` is its command."""
