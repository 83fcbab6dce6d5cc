"""Public name of the cable model in Exudyn, `reference.exudyn.cable`."""

from reference.exudyn.cable import OFFER, solve, solve_static

__all__ = ["OFFER", "solve", "solve_static"]
