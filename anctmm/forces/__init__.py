"""What acts: applied loads and driven clamps."""
