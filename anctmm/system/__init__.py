"""A scene as equations: mesh, unknowns, constraint rows, forces, tangents and mass, as tables for kernels."""
