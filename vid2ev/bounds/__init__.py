"""What may be left out: a scene as numbers, and how much at most a recording of it can change."""
