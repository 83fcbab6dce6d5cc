"""The same scenes in Exudyn."""
