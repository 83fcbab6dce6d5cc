"""Options of a run, integrators with their parameters, and the memory that a run needs."""
