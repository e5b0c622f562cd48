"""How kernels are compiled: no more than a walk calls for, once, by whoever is free, and again when sources change."""
