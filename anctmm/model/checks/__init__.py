"""Checks that the parts of a scene fit together."""
