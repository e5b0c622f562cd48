"""The modules of physics and kernels a second time, from the same text, for one pixel per thread.

A kernel on a CPU works on blocks of 2048 pixels and lanes of 1024; the distances of its planes are constants of its
modules.  With blocks and lanes of *one* pixel the same functions are what a thread of a GPU does for its pixel, and
their scratch is small enough for its registers.  So a **build** executes the modules anew, under the same names but
apart from those that are imported, and gives them other modules in the place of a few: widths, the compiler, what the
machine is asked for, where events go.
"""

from __future__ import annotations

import builtins
import importlib.util
import threading
from types import ModuleType, SimpleNamespace
from typing import Any

PARTS = ("vid2ev.kernels", "vid2ev.physics")
ALWAYS = {
    "vid2ev.kernels.widths": "vid2ev.kernels.cuda.one_pixel",
    "vid2ev.kernels.sink": "vid2ev.kernels.cuda.staged",
}
CARD = ALWAYS | {
    "vid2ev.compiling.compiler": "vid2ev.kernels.cuda.device_compiler",
    "vid2ev.compiling.extending": "vid2ev.kernels.cuda.device_extending",
    "vid2ev.compiling.intrinsics": "vid2ev.compiling.intrinsics",  # (its own text, by the other way in)
    "vid2ev.kernels.cuda.counter": "vid2ev.kernels.cuda.device_counter",
    "vid2ev.kernels.company": "vid2ev.kernels.cuda.warp",
}
SIMULATED = ALWAYS | {
    "vid2ev.compiling.compiler": "vid2ev.kernels.cuda.simulated_compiler",
    "vid2ev.kernels.cuda.machine": "vid2ev.kernels.cuda.simulated_machine",
}


class Build:
    """Modules of `parts` executed anew, with others in the place of those `exchanged` (name -> name)."""

    def __init__(self, exchanged: dict[str, str], parts: tuple[str, ...] = PARTS):
        self._exchanged, self._parts = exchanged, parts
        self._modules: dict[str, Any] = {}
        self._lock = threading.RLock()  # (a module is there before all of it has been executed)

    def module(self, name: str) -> Any:
        """A module of this build."""
        with self._lock:
            if name not in self._modules:
                self._execute(name)
            return self._modules[name]

    def _execute(self, name: str) -> None:
        spec = importlib.util.find_spec(self._exchanged.get(name, name))
        assert spec is not None and spec.origin is not None and spec.loader is not None
        module = self._modules[name] = ModuleType(name)
        module.__dict__.update(
            __file__=spec.origin, __builtins__=vars(builtins) | {"__import__": self._import}, __spec__=spec
        )
        exec(spec.loader.get_code(spec.name), module.__dict__)  # type: ignore[attr-defined]

    def _import(self, name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> Any:
        """`from name import ...`: ours, where it is ours."""
        if name in self._parts:
            return SimpleNamespace(**{part: self.module(f"{name}.{part}") for part in fromlist})
        if fromlist and (name in self._exchanged or name.startswith(tuple(f"{part}." for part in self._parts))):
            return self.module(name)
        return builtins.__import__(name, globals, locals, fromlist, level)
