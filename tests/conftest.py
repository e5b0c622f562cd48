"""What all tests have in common."""

from __future__ import annotations

import os
import signal

from hypothesis import settings

# (tests say nothing of how long things take: the first example of many compiles kernels)
settings.register_profile("without a clock", deadline=None)
settings.load_profile("without a clock")

# (a shell has what it starts in the background ignore Ctrl-C, and so would all that tests start)
signal.signal(signal.SIGINT, signal.default_int_handler)

# (what a program says on a slow machine is what it says on any: tqdm shows nothing where no terminal is)
os.environ["TQDM_DISABLE"] = "1"
