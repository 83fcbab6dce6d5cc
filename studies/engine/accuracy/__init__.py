"""Old places of names, until the rooms that import them from here are rewritten."""
