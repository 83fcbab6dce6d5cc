"""Old place."""

from studies.engine.refinement import element_of

__all__ = ["element_of"]
