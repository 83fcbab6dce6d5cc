"""Results of runs: solutions, their fields and energies, comparisons, checks."""
