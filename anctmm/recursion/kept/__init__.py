"""The system of kept unknowns: of loops, of constraints, and of connectors between distant nodes."""
