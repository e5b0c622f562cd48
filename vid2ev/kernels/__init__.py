"""How the physics is computed: the walk over the pixels on a CPU."""
