"""Static equilibria and their stability: along a growing load, through limit points, on the stable branch."""

from anctmm.integrators.statics.equilibria import solve_static

__all__ = ["solve_static"]
