"""Timing: solvers in alternating runs, on one thread, after a warm-up; and the settings of the benchmark."""
