"""Types that constructors accept: any ordered iterable of objects, any pair of numbers.

Attributes have the validated values, as tuples. Classes of one kind have a common base, so that a list of several of
them is a list of that kind for type checkers, whatever its order.
"""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

PairLike = Sequence[float] | NDArray[np.floating] | NDArray[np.integer]
"""Two numbers: a tuple, a list, an array."""


class BodyKind:
    """Base of all bodies."""


class JointKind:
    """Base of all joints. Its class says what a joint does."""

    #: Whether it holds the direction of its places.
    holds_direction: ClassVar[bool]
    #: Whether its place moves on a line, along which a drive moves it; drives of other joints turn.
    on_line: ClassVar[bool]


class LoadKind:
    """Base of all loads."""


class ConnectorKind:
    """Base of all connectors."""
