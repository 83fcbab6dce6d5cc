"""Forces inside a scene: what acts on it, what joints exert, what a section transmits."""
