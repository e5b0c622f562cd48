"""How events are seen: cut into slices, and each slice made an array or a picture."""
