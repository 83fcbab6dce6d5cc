"""Whole turns: by which of the angles that differ by them a section has rotated.

The direction at an output determines an angle up to whole turns. Along a beam neighbouring sections differ by less than
half a turn, so one place of a body determines all others, at each output separately. What a clamp, a weld or a guide
holds has rotated as much as the part that holds it, plus the rotation of their drive. Turns of bodies that are free to
rotate are counted at each step (`integrators.turn_count`). If a solver does not count them, a body is followed from one
output to the next by its mean angular velocity: outputs must then be less than half a turn apart, or the rate must
change little between them.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import AnctmmError
from anctmm.model.drives import tabulate
from anctmm.model.joints import Joint, drive_of
from anctmm.model.places import Place
from anctmm.model.topology import GROUND, held_directions, turning_bodies
from anctmm.results.fields import Field, HermiteField, RigidField, Root, nearest

Array = NDArray[np.float64]


class WholeTurns:
    """Angles since the undeformed scene at the outputs of a solution, whole turns included.

    Parameters
    ----------
    scene : Scene
    fields : mapping of str to Field
        Motion of each body.
    t : ndarray, shape (n,)
        s; load factors of a static one.
    static : bool
        Whether it is one: drives do not move.
    """

    def __init__(self, scene: Any, fields: Mapping[str, Field], t: Array, static: bool = False) -> None:
        self.scene, self.fields, self.t, self.static = scene, fields, t, static

    def angle(self, name: str, place: Any) -> Array:
        """Angles of a place of a body, (n,), rad."""
        field: Any = self.fields[name]
        if not isinstance(field, HermiteField | RigidField):  # it keeps angles, with all turns
            return np.asarray(field.angle(place, self.t))
        if field.counted(self.t):
            return np.asarray(field.turned_before(place) + field.angle(place, self.t))
        with np.errstate(all="ignore"):  # of a run that has diverged
            return np.asarray(field.angle_from(place, self._roots[name]))

    def of_nodes(self, name: str) -> Array:
        """Angles of all nodes of a beam of ANCF elements, or of a rigid body, (n, nodes), rad."""
        field: Any = self.fields[name]
        if field.counted(self.t):
            return np.asarray(field.turned)
        with np.errstate(all="ignore"):
            return np.asarray(field.node_angles(self._roots[name]))

    @cached_property
    def _roots(self) -> dict[str, Root]:
        """A place of each body whose angle is known, with its angles."""
        found: dict[str, Root] = {}
        self._follow(GROUND, found)
        # first those that solvers count: all others follow
        for name in [*turning_bodies(self.scene), *self.fields]:
            field = self.fields.get(name)
            if name not in found and isinstance(field, HermiteField | RigidField):
                found[name] = field.own_root(self.t)
                self._follow(name, found)
        return found

    def _follow(self, first: str | None, found: dict[str, Root]) -> None:
        """Find the roots of all bodies that a body, or the ground, holds or is held by, directly or by others."""
        ahead = [first]
        for here in ahead:
            for known, place, turn in self._beside.get(here, []):
                field: Any = self.fields.get(place.body.name)
                if place.body.name in found or not isinstance(field, HermiteField | RigidField):
                    continue
                before: Any = 0.0
                if known is not None:
                    body: Any = self.fields[known.body.name]
                    before = body.angle_from(known.key, found[known.body.name])
                about: Any = field.direction_angle(place.key)  # type: ignore[arg-type]  # it fits the body
                found[place.body.name] = Root(place.key, nearest(about, before + turn))
                ahead.append(place.body.name)

    @cached_property
    def _beside(self) -> dict[str | None, list[tuple[Place | None, Place, Array]]]:
        """By body, or the ground: its places that joints hold to others, these, and the turn from one to the other."""
        found: dict[str | None, list[tuple[Place | None, Place, Array]]] = {}
        for by, place, turn in self._held():
            found.setdefault(by.body.name if by else GROUND, []).append((by, place, turn))
            if by is not None:
                found.setdefault(place.body.name, []).append((place, by, -turn))
        return found

    def _held(self) -> Iterator[tuple[Place | None, Place, Array]]:
        """Directions that joints hold, and what their drives turn, (n,), rad.

        Without those whose function is not there, as in a solution that was read from a file.
        """
        for joint, by, place in held_directions(self.scene):
            with suppress(AnctmmError):
                yield by, place, self._turn(joint)

    def _turn(self, joint: Joint) -> Array:
        drive = None if joint.on_line or self.static else drive_of(joint)
        if drive is None:
            return np.zeros(len(self.t))
        return np.asarray(tabulate(drive[0], drive[1], self.t, 3)[:, 0])
