"""How a scene is cut: mesh, assembly of elements, order of elimination."""
