"""Marks of single cases of a test."""

import pytest


def slow_where(slow, cases):
    """Cases of `parametrize`, those marked slow of which a function says so."""
    return [pytest.param(case, marks=pytest.mark.slow) if slow(case) else case for case in cases]
