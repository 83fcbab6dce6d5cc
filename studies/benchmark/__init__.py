"""Benchmark: what a step costs, beside other solvers."""
