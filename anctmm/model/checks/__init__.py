"""Whether what a scene holds fits together."""
