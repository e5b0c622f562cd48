"""How much of it: how far two recordings are from each other."""
