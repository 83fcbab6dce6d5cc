"""A gallery: short scenes, each with its picture and a value that is known independently."""
