"""What is told to numba, and what it does otherwise for kernels."""
