"""What holds at the extremes of a user's case."""
