"""What all tests have in common."""

from __future__ import annotations

from hypothesis import settings

# (tests say nothing of how long things take: the first example of many compiles kernels)
settings.register_profile("without a clock", deadline=None)
settings.load_profile("without a clock")
