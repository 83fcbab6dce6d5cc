"""Public names of the results of a solver, `anctmm.results.solution`."""

from anctmm.results.fields import HermiteField, LagrangeField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status

__all__ = ["Cost", "Energy", "HermiteField", "LagrangeField", "Solution", "Status"]
