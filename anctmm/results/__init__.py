"""What a run answers: solutions, their fields and energies, comparisons, divergence checks."""
