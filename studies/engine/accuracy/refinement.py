"""Old place."""

from studies.engine.meshes import coarsest_mesh, longest_step

__all__ = ["coarsest_mesh", "longest_step"]
