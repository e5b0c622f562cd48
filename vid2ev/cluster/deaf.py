"""What Dask loads into each process of `--jobs`: Ctrl-C, which a terminal sends to all, is the business of the command,
which then ends them."""

from __future__ import annotations

import signal


def dask_setup(_: object) -> None:
    """Called by Dask when the process begins."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
