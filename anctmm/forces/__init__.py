"""Loads, connectors and driven clamps, and their histories in time."""
