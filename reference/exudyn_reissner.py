"""Public name of the Reissner model in Exudyn, `reference.exudyn.reissner`."""

from reference.exudyn.reissner import OFFER, python_callbacks, solve, solve_static

__all__ = ["OFFER", "python_callbacks", "solve", "solve_static"]
