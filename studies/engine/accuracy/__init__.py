"""How well a value is known: sweeps over meshes and steps, references, estimates from refinement, digits that hold."""
