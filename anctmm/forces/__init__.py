"""What acts: loads, connectors and driven clamps, and their histories in time."""
