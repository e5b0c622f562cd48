"""Codes and pictures <-> linear light: transfer curves, primaries, luminance, picture files, resampling."""
