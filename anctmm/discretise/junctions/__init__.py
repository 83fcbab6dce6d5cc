"""Junctions: beams divided at joints, vertices of the graph, constraints."""
