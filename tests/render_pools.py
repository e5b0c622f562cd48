"""Pools of threads by which scenes are rendered."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import ModuleType

import pytest

from vid2ev.scenes import render


def pools_begun(monkeypatch: pytest.MonkeyPatch, cores: int, counted_by: ModuleType) -> set[int]:
    """Of how many threads those are that begin from now on, where that many cores are for this process; `counted_by`
    is a module that asks for them beside the renderer."""
    begun: set[int] = set()

    class Pool(ThreadPoolExecutor):
        def __init__(self, threads: int):
            begun.add(threads)
            super().__init__(threads)

    monkeypatch.setattr(render, "ThreadPoolExecutor", Pool)
    for module in (render, counted_by):
        monkeypatch.setattr(module, "usable_cores", lambda: cores)
    return begun
