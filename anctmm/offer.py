"""Public name of what a solver says it can do, `anctmm.solvers.capabilities`."""

from anctmm.solvers.capabilities import Offer

__all__ = ["Offer"]
