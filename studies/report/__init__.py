"""Pictures, animations, terminal and page."""
