"""What all tests have in common."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import settings

# (tests say nothing of how long things take: the first example of many compiles kernels)
settings.register_profile("without a clock", deadline=None)
settings.load_profile("without a clock")

# (a shell has what it starts in the background ignore Ctrl-C, and so would all that tests start)
signal.signal(signal.SIGINT, signal.default_int_handler)

# (what a program says on a slow machine is what it says on any: tqdm shows nothing where no terminal is)
os.environ["TQDM_DISABLE"] = "1"


@pytest.fixture
def asks_again(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From when this is called on, Ctrl-C comes as a folder is cleared up."""
    remove = shutil.rmtree

    def asked(*arguments: Any, **options: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        remove(*arguments, **options)

    return lambda: monkeypatch.setattr(shutil, "rmtree", asked)
