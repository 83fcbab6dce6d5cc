"""Compiling kernels and keeping them."""
