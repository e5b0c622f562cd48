"""Worlds with known depth, poses and flow, and the pictures that a camera would take of them."""
