"""Types that constructors accept: any ordered iterable of objects, any pair of numbers.

Attributes have the validated values, as tuples. Classes of one kind have a common base, so that a list of several of
them is a list of that kind for type checkers, whatever its order.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

Point = Sequence[float] | NDArray[np.floating] | NDArray[np.integer]
"""Two numbers in the plane, three in space: a tuple, a list, an array. Attributes have tuples."""


class Part:
    """Base of all parts of a scene."""

    #: Whether it is offered in space, too.
    in_space: ClassVar[bool] = False

    @property
    def features(self) -> dict[str, bool]:
        """Features of `anctmm.model.needs.MECHANISMS`, and whether a solver needs them for this part."""
        return {}

    @property
    def places(self) -> tuple[Any, ...]:
        """Places of bodies that it acts on."""
        return ()

    def misfit(self, scene: Any) -> str:
        """Why it is not offered in the plane, or in the space, of a scene; empty if it is."""
        return "" if self.in_space or scene.dim == 2 else "is for the plane alone"


class BodyKind(Part):
    """Base of all bodies."""


class JointKind(Part):
    """Base of all joints."""


class LoadKind(Part):
    """Base of all loads."""


class ConnectorKind(Part):
    """Base of all connectors."""
