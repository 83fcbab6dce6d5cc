"""Old place."""

from studies.engine.trials import STATIC, Mesh, Trial, guarded, mesh_label, product

__all__ = ["STATIC", "Mesh", "Trial", "guarded", "mesh_label", "product"]
