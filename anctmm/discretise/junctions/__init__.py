"""What meets at junctions: vertices of the graph of bodies, constraints between kept unknowns, loops that lock."""
