"""In the place of `vid2ev.compiling.extending` on a GPU."""

from numba.cuda.extending import intrinsic as intrinsic
