"""Velocities at the start that satisfy joints and drives."""
