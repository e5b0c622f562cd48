"""The ray caster on a GPU: a thread for each pixel, several pictures at a time, by the same text as on a CPU.

`threads` is what a thread does, `kernels` what a GPU is asked for.  `vid2ev.kernels.cuda.build` executes the laws of
rays a second time, with `device_compiler` in the place of their compiler; a simulated GPU takes those of the CPU.
"""
