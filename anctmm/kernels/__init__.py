"""How kernels are compiled, stored, announced and interrupted."""
