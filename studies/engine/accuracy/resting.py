"""Old place."""

from studies.engine.refinement import turn_at_rest

__all__ = ["turn_at_rest"]
