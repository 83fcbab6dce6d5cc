"""Discretisation of a scene: mesh, assembly of elements, order of elimination."""
