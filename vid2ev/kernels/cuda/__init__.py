"""The walk on a GPU: a thread for each pixel, several frames at a time, by the same text of physics as on a CPU.

`build` reads the modules of physics and kernels a second time, with blocks and lanes of one pixel and the compiler of
the GPU; `pixel` is what a thread does, `kernels` what a GPU is asked for.
"""
