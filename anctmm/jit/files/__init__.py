"""Compiled kernels on disk: their names, their files, and who may write them."""
