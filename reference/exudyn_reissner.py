"""Public name of the Reissner model in Exudyn, `reference.exudyn.reissner`."""

from reference.exudyn.reissner import OFFER, solve, solve_static

__all__ = ["OFFER", "solve", "solve_static"]
