"""Bands: the rows of a picture shared out among threads.

What a kernel writes to a row depends on that row alone, so the number of threads changes nothing but the time it takes.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from vid2ev.errors import UsageError


class Bands:
    """Runs kernels on `threads` bands of rows at a time, one of them here; they release the interpreter's lock."""

    def __init__(self, threads: int = 1):
        if threads < 1:
            raise UsageError(f"threads {threads}: expected at least 1; leave it out for one")
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def run(self, rows: int, kernel: Callable[..., None], *arguments: object) -> None:
        """kernel(begin, end, *arguments) for bands that make up `rows` rows."""
        edges = [rows * k // self.threads for k in range(self.threads + 1)]
        others = []
        if self._pool:
            others = [self._pool.submit(kernel, *edges[k : k + 2], *arguments) for k in range(1, self.threads)]
        kernel(edges[0], edges[1], *arguments)
        for other in others:
            other.result()
