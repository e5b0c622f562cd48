"""In the place of `vid2ev.kernel_extending` on a GPU."""

from numba.cuda.extending import intrinsic as intrinsic
