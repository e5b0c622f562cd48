"""From where it is seen: cameras and their poses, depth, views."""
