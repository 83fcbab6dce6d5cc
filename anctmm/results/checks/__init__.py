"""Checks of a finished history or an equilibrium: what they find determines the status of a solution."""
