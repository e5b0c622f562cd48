"""How much of it: what of a sensor a scene calls for."""
