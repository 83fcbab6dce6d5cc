"""Static equilibria and their stability: along a growing load, through limit points, on the stable branch."""

from anctmm.equilibria.statics import solve_static

__all__ = ["solve_static"]
