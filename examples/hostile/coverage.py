"""Which lines of vid2ev and interp have run, cheaply: a function of which all lines have is not looked at again."""

from __future__ import annotations

import sys
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

ROOTS = tuple(str(Path(__file__).resolve().parents[2] / name) for name in ("vid2ev", "interp"))


class Coverage:
    """Looks at what runs within `with`; `found` is how many lines ran for the first time in it."""

    def __init__(self) -> None:
        self._left: dict[CodeType, set[int]] = {}
        self.found = 0

    def __enter__(self) -> Coverage:
        self.found = 0
        sys.settrace(self._begin)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _begin(self, frame: FrameType, event: str, argument: Any) -> Any:
        code = frame.f_code
        left = self._left.get(code)
        if left is None:
            own = code.co_filename.startswith(ROOTS)
            left = {line for _, _, line in code.co_lines() if line} - {code.co_firstlineno} if own else set()
            self._left[code] = left
        return self._step if left else None

    def _step(self, frame: FrameType, event: str, argument: Any) -> Any:
        left = self._left[frame.f_code]
        if frame.f_lineno in left:
            left.discard(frame.f_lineno)
            self.found += 1
            if not left:
                frame.f_trace_lines = False
        return self._step
