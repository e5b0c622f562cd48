"""Pictures of an evaluation, as functions on arrays: R'G'B' uint8 [H, W, 3] in, the same out."""
