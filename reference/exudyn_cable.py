"""Public name of the cable model in Exudyn, `reference.exudyn.cable`."""

from reference.exudyn.cable import OFFER, python_callbacks, solve, solve_static

__all__ = ["OFFER", "python_callbacks", "solve", "solve_static"]
