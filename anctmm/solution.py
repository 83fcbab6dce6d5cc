"""Public names of what a solver answers, `anctmm.results.solution`."""

from anctmm.results.solution import Cost, Energy, HermiteField, LagrangeField, Solution, Status

__all__ = ["Cost", "Energy", "HermiteField", "LagrangeField", "Solution", "Status"]
