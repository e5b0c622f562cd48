"""Where numba takes functions that are written in its own terms: for a CPU (for a GPU it has another place)."""

from numba.core.extending import intrinsic as intrinsic
