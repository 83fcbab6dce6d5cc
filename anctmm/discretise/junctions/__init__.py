"""What meets at junctions: beams cut where joints act, vertices of the graph, constraints, loops that lock."""
