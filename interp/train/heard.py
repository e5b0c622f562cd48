"""Who hears SIGTERM while a network is trained.

Lightning takes it, and has its processes wait for each other at once, in the midst of whatever they do.  Where all of
them get it, as from a cluster or a service that ends, they wait for ever.
"""

from __future__ import annotations

import signal
import threading
from typing import Any

from lightning.pytorch import Callback


class HeardAsBefore(Callback):
    """SIGTERM stays with whoever has heard it before, who ends all processes after a step (`session.Limits.stop`)."""

    def setup(self, *_: Any, **__: Any) -> None:
        """Nobody has taken it yet."""
        self._before = signal.getsignal(signal.SIGTERM)

    def on_train_start(self, *_: Any) -> None:
        """Now it is taken."""
        self._give_back()

    def on_validation_start(self, *_: Any) -> None:
        """The same before training."""
        self._give_back()

    def _give_back(self) -> None:
        if threading.current_thread() is threading.main_thread():  # (in others nobody takes it)
            signal.signal(signal.SIGTERM, self._before)
