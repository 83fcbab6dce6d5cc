"""A run by the kind of steps that is asked for."""

from anctmm.integrators import control, fixed
from anctmm.results.solution import Solution
from anctmm.system.system import System


def integrate(system: System, start: Solution | None = None) -> Solution:
    """Run a system from its start, or from an equilibrium, with fixed steps or with a tolerance."""
    steps = fixed if system.run.tolerance is None else control
    return steps.integrate(system, start)
