"""Finite elements: energy, force, tangent and mass of one element, nothing of how elements are joined."""
