"""Samples to train with: clips made on the fly by the simulator, or cut from recordings on disk."""
