"""Finite elements: energy, force, tangent and mass of one element, independent of joints."""
