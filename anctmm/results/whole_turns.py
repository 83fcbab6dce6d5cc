"""Whole turns: by which of the angles that differ by them a section has rotated.

The direction at an output determines an angle up to whole turns. Along a beam neighbouring sections differ by less than
half a turn, so one place of a body determines all others, at each output separately. Turns of that place are counted at
each step. If a solver does not count them, it is followed from one output to the next, which must be less than half a
turn apart.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.results.fields import Field, as_complex

Array = NDArray[np.float64]


class WholeTurns:
    """Angles since the undeformed scene at the outputs of a solution."""

    def __init__(self, fields: Mapping[str, Field], t: Array) -> None:
        self.fields, self.t = fields, t

    def angle(self, name: str, place: Any) -> Array:
        """Angles of a place of a body, (n,), rad."""
        field: Any = self.fields[name]
        if not hasattr(field, "turned"):  # it keeps angles, with all turns
            return np.asarray(field.angle(place, self.t))
        here, known = as_complex(field.direction(place)), 0.0
        if field.turned is not None and len(here):
            node = field.node(place)
            beside = as_complex(field.node_directions[0, node])
            known = float(field.turned[0, node] + np.angle(here[0] * np.conj(beside)))
        with np.errstate(all="ignore"):  # of a run that has diverged
            found = np.angle(here * np.conj(here[:1])) + known
            about = self.of_nodes(name)[:, field.node(place)]
            return np.asarray(found + 2.0 * np.pi * np.round((about - found) / (2.0 * np.pi)))

    def of_nodes(self, name: str) -> Array:
        """Angles of all nodes of a beam of ANCF elements, or of a rigid body, (n, nodes), rad.

        From node to node they change by less than π.
        """
        field: Any = self.fields[name]
        if field.turned is not None and len(field.turned) == len(self.t):
            return np.asarray(field.turned)
        vectors = as_complex(field.node_directions)
        with np.errstate(all="ignore"):
            found = np.angle(vectors * np.conj(vectors[:1]))
            found += 0.0 if field.turned is None else field.turned[:1]
            found[:, 0] = _first_angle(field)
            return np.unwrap(found, axis=1)


def _first_angle(field: Any) -> Array:
    """Angle of the first node since the undeformed scene, (n,), rad: as counted, or by less than π an output."""
    before = 0.0 if field.turned is None else field.turned[:1, 0].sum()
    if field.start_angle is not None:
        return np.asarray(before + field.start_angle - field.start_angle[:1])
    vectors = as_complex(field.node_directions[:, 0])
    return np.asarray(before + np.unwrap(np.angle(vectors * np.conj(vectors[:1]))))
