"""Public name of the capabilities of a solver, `anctmm.solvers.capabilities`."""

from anctmm.solvers.capabilities import Offer

__all__ = ["Offer"]
