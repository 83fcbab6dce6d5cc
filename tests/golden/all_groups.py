"""All groups: importing a module registers its groups."""

from tests.golden import (
    connectors,
    elements,
    endings,
    equilibria,
    joints,
    mechanisms,
    published,
    small_motions,
)
from tests.golden.answers import GROUPS

__all__ = [
    "GROUPS",
    "connectors",
    "elements",
    "endings",
    "equilibria",
    "joints",
    "mechanisms",
    "published",
    "small_motions",
]
