"""Accuracy of values: sweeps over meshes and steps, references, estimates by refinement, correct digits."""
