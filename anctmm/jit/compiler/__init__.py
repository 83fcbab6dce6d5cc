"""Settings and extensions of numba for kernels."""
