"""Old place."""

from studies.engine.study import check_mesh

__all__ = ["check_mesh"]
