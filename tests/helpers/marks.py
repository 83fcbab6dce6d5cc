"""Marks of single cases of a test."""

import pytest


def exhaustive_where(long, cases):
    """Cases of `parametrize`, those marked exhaustive of which a function says so."""
    return _marked(pytest.mark.exhaustive, long, cases)


def slow_where(long, cases):
    """Cases of `parametrize`, those marked slow of which a function says so."""
    return _marked(pytest.mark.slow, long, cases)


def _marked(mark, chosen, cases):
    return [pytest.param(case, marks=mark) if chosen(case) else case for case in cases]
