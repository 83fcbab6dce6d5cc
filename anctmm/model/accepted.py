"""Types that constructors accept: any ordered iterable of objects, any pair of numbers.

Attributes have the validated values, as tuples. Classes of one kind have a common base, so that a list of several of
them is a list of that kind for type checkers, whatever its order.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

PairLike = Sequence[float] | NDArray[np.floating] | NDArray[np.integer]
"""Two numbers: a tuple, a list, an array."""


class BodyKind:
    """Base of all bodies."""


class JointKind:
    """Base of all joints."""


class LoadKind:
    """Base of all loads."""


class ConnectorKind:
    """Base of all connectors."""
