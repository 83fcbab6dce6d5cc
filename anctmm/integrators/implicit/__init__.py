"""What implicit methods share: system, steps, Newton's iteration, how a run starts, goes on and fails."""
