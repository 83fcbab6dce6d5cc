"""Static equilibria: along a growing load, past limit points, on the stable branch, and whether they are stable."""

from anctmm.integrators.statics.equilibria import solve_static

__all__ = ["solve_static"]
