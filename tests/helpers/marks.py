"""Marks of single cases of a test."""

import pytest


def exhaustive_where(long, cases):
    """Cases of `parametrize`, those marked exhaustive of which a function says so."""
    return [pytest.param(case, marks=pytest.mark.exhaustive) if long(case) else case for case in cases]
