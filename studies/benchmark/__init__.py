"""Benchmark: what a step costs, beside other solvers or in another checkout."""
