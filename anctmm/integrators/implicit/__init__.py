"""Parts that implicit methods share: system, steps, Newton's iteration, start, continuation and failure of a run."""
