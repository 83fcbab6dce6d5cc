"""Compiled kernels on disk: names, files, and permissions."""
