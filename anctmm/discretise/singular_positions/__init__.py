"""Rigid bodies in singular positions, which are refused: dead centres, loops that are taut or folded."""
