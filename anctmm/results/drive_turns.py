"""Whole turns between two outputs of what drives turn: velocities at the outputs do not tell them where these are rare.

A crank that turns once from rest to rest between two outputs has no velocity at either. What is clamped or welded to it
turns as its drive does, but for what bends, and that is told by the velocities.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from anctmm.model.drives import tabulate
from anctmm.model.joints import drive_of
from anctmm.model.topology import GROUND, held_directions
from anctmm.results.fields import Field, HermiteField, RigidField

Array = NDArray[np.float64]
F = TypeVar("F", bound=Field)
C = TypeVar("C", bound=HermiteField | RigidField)


def with_turns_of_drives(scene: Any, fields: Mapping[str, F], t: Array) -> dict[str, F]:
    """Fields of a motion, of any solver; of bodies that drives turn further than velocities tell angles are counted."""
    found = dict(fields)
    if len(t) < 2 or not any(not j.on_line and drive_of(j) for j in scene.joints):
        return found
    for name, (angle, rate) in _driven(scene, t).items():
        told = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)  # by velocities, from one output to the next
        field = found[name]  # another kind keeps angles as they are, with all turns
        if isinstance(field, HermiteField | RigidField) and np.abs(told - np.diff(angle)).max() > np.pi:
            with np.errstate(all="ignore"):  # of a run that has diverged
                found[name] = cast(F, _counted(field, angle, rate, t))
    return found


def _driven(scene: Any, t: Array) -> dict[str, tuple[Array, Array]]:
    """Angles and rates of the drives between the ground and each body that it holds the direction of, each (n,)."""
    edges: dict[str | None, list[tuple[str | None, Array]]] = {}
    for joint, first, other in held_directions(scene):
        turns = np.zeros((2, len(t)))
        drive = None if joint.on_line else drive_of(joint)
        if drive is not None:
            turns = tabulate(drive[0], drive[1], t, 3)[:, :2].T
        edges.setdefault(first, []).append((other, turns))
        edges.setdefault(other, []).append((first, -turns))
    found: dict[str | None, Array] = {GROUND: np.zeros((2, len(t)))}
    ahead: list[str | None] = [GROUND]
    for here in ahead:
        for there, turns in edges.get(here, []):
            if there not in found:
                found[there] = found[here] + turns
                ahead.append(there)
    return {name: (turns[0], turns[1]) for name, turns in found.items() if name is not None and turns.any()}


def _counted(field: C, angle: Array, rate: Array, t: Array) -> C:
    """A field whose angles at its nodes are counted with the turn of what drives it."""
    if isinstance(field, HermiteField):
        places: list[Any] = np.linspace(0.0, 1.0, field.coordinates.shape[1]).tolist()
    else:
        places = ["center"]
    turned = []
    for place in places:
        beside = field.spin(place) - rate
        steps = np.diff(field.angle(place, t))
        expected = np.diff(angle) + 0.5 * (beside[1:] + beside[:-1]) * np.diff(t)
        steps += 2.0 * np.pi * np.round((expected - steps) / (2.0 * np.pi))
        turned.append(field.turned_before(place) + np.concatenate([[0.0], np.cumsum(steps)]))
    return replace(field, turned=np.stack(turned, axis=1))
