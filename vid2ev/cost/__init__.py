"""What accuracy costs in time, on one's own clip and machine."""
