"""Whole turns: by which of the angles that differ by them a section has rotated.

The direction at an output determines an angle up to whole turns. Along a beam neighbouring sections differ by less than
half a turn, so one place of a body determines all others, at each output separately. What a clamp, a weld or a guide
holds has rotated as much as the part that holds it, plus the rotation of their drive. Turns of bodies that are free to
rotate are counted at each step. If a solver does not count them, a body is followed from one output to the next by its
mean angular velocity: outputs must then be less than half a turn apart, or the rate must change little between them.
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
from anctmm.results.fields import Complex, Field, HermiteField, NodalField, RigidField, as_complex

Array = NDArray[np.float64]


class WholeTurns:
    """Angles since the undeformed scene at the outputs of a solution; drives of a static one do not move."""

    def __init__(self, scene: Any, fields: Mapping[str, Field], t: Array, static: bool = False) -> None:
        self.scene, self.fields, self.t, self.static = scene, fields, t, static

    def angle(self, name: str, place: Any) -> Array:
        """Angles of a place of a body, (n,), rad."""
        field: Any = self.fields[name]
        if not hasattr(field, "turned"):  # it keeps angles, with all turns
            return np.asarray(field.angle(place, self.t))
        with np.errstate(all="ignore"):  # of a run that has diverged
            return nearest(direction_angle(field, place), self.of_nodes(name)[:, field.node(place)])

    def of_nodes(self, name: str) -> Array:
        """Angles of all nodes of a beam of ANCF elements, or of a rigid body, (n, nodes), rad."""
        field: Any = self.fields[name]
        if field.turned is not None and len(field.turned) == len(self.t):
            return np.asarray(field.turned)
        with np.errstate(all="ignore"):
            return _along_nodes(field, *self._known[name])

    @cached_property
    def _known(self) -> dict[str, tuple[int, Array]]:
        """A node of each body whose angles are known, with these."""
        found: dict[str, tuple[int, Array]] = {}
        self._follow(GROUND, found)
        # first those that solvers count: all others follow
        for name in [*turning_bodies(self.scene), *self.fields]:
            field = self.fields.get(name)
            if name not in found and isinstance(field, NodalField):
                found[name] = 0, _own_angle(field, self.t)
                self._follow(name, found)
        return found

    def _follow(self, first: str | None, found: dict[str, tuple[int, Array]]) -> None:
        """Find the angles of all bodies that a body, or the ground, holds or is held by, directly or by others."""
        ahead = [first]
        for here in ahead:
            for by, place, turn in self._beside.get(here, []):
                name, field = place.body.name, self.fields.get(place.body.name)
                if name in found or not isinstance(field, HermiteField | RigidField):
                    continue
                before: Any = 0.0 if by is None else self._angle_from(by, found)
                node = field.node(place.key)  # type: ignore[arg-type]  # it fits the body
                about = nearest(direction_angle(field, place.key), before + turn)
                found[name] = node, nearest(node_angles(field)[:, node], about)
                ahead.append(name)

    def _angle_from(self, place: Place, found: Mapping[str, tuple[int, Array]]) -> Array:
        field: Any = self.fields[place.body.name]
        along = _along_nodes(field, *found[place.body.name])
        return nearest(direction_angle(field, place.key), along[:, field.node(place.key)])

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


def direction_angle(field: Any, place: Any) -> Array:
    """Angle of a place since the undeformed scene, (n,), rad, up to whole turns."""
    here, known = as_complex(field.direction(place)), 0.0
    if field.turned is not None and len(here):
        node = field.node(place)
        beside = as_complex(field.node_directions[0, node])
        known = float(field.turned[0, node] + np.angle(here[0] * np.conj(beside)))
    return np.asarray(np.angle(here * np.conj(here[:1])) + known)


def node_angles(field: Any) -> Array:
    """The same of all nodes, (n, nodes)."""
    vectors = as_complex(field.node_directions)
    found = np.angle(vectors * np.conj(vectors[:1]))
    return np.asarray(found if field.turned is None else found + field.turned[:1])


def _along_nodes(field: Any, node: int, known: Array) -> Array:
    """Angles of all nodes, (n, nodes), rad, from those of one; from node to node they change by less than π."""
    found = node_angles(field)
    found[:, node] = known
    found[:, node:] = np.unwrap(found[:, node:], axis=1)
    found[:, node::-1] = np.unwrap(found[:, node::-1], axis=1)
    return found


def _own_angle(field: Any, t: Array) -> Array:
    """Angle of the first node since the undeformed scene, (n,), rad: as counted, or by the rate of the body."""
    before = 0.0 if field.turned is None else field.turned[:1, 0].sum()
    if field.start_angle is not None:
        return np.asarray(before + field.start_angle - field.start_angle[:1])
    return np.asarray(before + continuous(as_complex(field.node_directions[:, 0]), _mean_spin(field), t))


def _mean_spin(field: Any) -> Array | None:
    """Rate of a rigid body, or that at which a beam's nodes turn about their middle in the mean, (n,), rad/s."""
    if field.velocities is None:
        return None
    if isinstance(field, RigidField):
        return field.spin("center")
    arms, rates = (as_complex(x[:, :, 0]) for x in (field.coordinates, field.velocities))
    arms, rates = (x - x.mean(axis=1, keepdims=True) for x in (arms, rates))
    return np.asarray(np.imag(rates * np.conj(arms)).sum(axis=1) / (np.abs(arms) ** 2).sum(axis=1))


def continuous(vectors: Complex, spin: Array | None, t: Array) -> Array:
    """Angle that a vector has turned by since the first time, (n,), rad.

    From one time to the next a direction determines the rotation up to whole turns. These follow from its rate `spin`,
    (n,), rad/s; without it the rotation is less than half a turn.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.angle(vectors[1:] * np.conj(vectors[:-1]))
        if spin is not None:
            steps = nearest(steps, 0.5 * (spin[1:] + spin[:-1]) * np.diff(t))
    return np.concatenate([np.zeros(min(len(vectors), 1)), np.cumsum(steps)])


def nearest(angle: Array, about: Array) -> Array:
    """The angles, rad, with those whole turns that bring them nearest to others."""
    return np.asarray(angle + 2.0 * np.pi * np.round((about - angle) / (2.0 * np.pi)))
