"""Execution of runs: in this process, by worker processes, or on a cluster; times separately, by alternating runs."""
