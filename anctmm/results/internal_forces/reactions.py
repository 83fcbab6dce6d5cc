"""Reactions of joints: their forces on the places that they hold, from the equilibrium of the bodies.

The total force on an end of a flexible beam is known (`section_forces`); that on a rigid body, or on a beam of element
"rigid", is m r̈ and I θ̈ less the other loads on it (`rigid`). Joints that share a place or a rigid body are solved
together. The unknowns are the force and moment of each joint on each of its places. The equations: at each place or
body they sum up to the known total; over the places of a joint that is not fixed to the ground they sum up to zero; in
directions that a joint leaves free they vanish.

These are more equations than unknowns, and what a solution has of a body's accelerations is not exact: an error δ of
them is a force m δ in its equation, as large as all that a body of a millionth of its mass bears. So the equations of a
body count by what they say of its accelerations: the sum of |m r̈ − F − R|² / m is the least. That is
Gauss' principle of least constraint (J. reine angew. Math. 4, 1829, 232-235), by which errors along what joints leave
free are no forces.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.errors import ResultError, UnknownNameError, shown, unknown_kind
from anctmm.model.joints import JOINTS, Clamp, Guide, Joint, Pin, Prismatic, Slider, Weld
from anctmm.model.places import Place
from anctmm.model.topology import Sets
from anctmm.results.internal_forces.actions import turn_since_placed
from anctmm.results.internal_forces.rigid import holding, inertia_of, is_rigid
from anctmm.results.internal_forces.section_forces import HeldElement, element_count

Array = NDArray[np.float64]

#: Of the largest singular value: what counts as none; of a unit of a reaction: the part that cannot be known.
NONE, UNKNOWN = 1e-10, 1e-6
#: Weight of an equation without error, such as that of a joint, over the largest of others.
EXACT = 1e8


def reaction(solution: Any, joint: Joint) -> Array:
    """What a joint exerts on its first place, (n, 3): N, N, N m, in fixed axes.

    Parameters
    ----------
    solution : Solution
    joint : Pin, Weld, Clamp, Slider or Prismatic
        Of the scene.

    Returns
    -------
    ndarray, shape (n, 3)
        Force along x and y, and the moment, counter-clockwise.

    Raises
    ------
    UnknownNameError
        If the joint is not of the scene.
    ResultError
        If the solution does not have what reactions are found from, or the joints repeat each other among rigid
        bodies, so that equilibrium alone does not determine their forces.
    """
    scene = solution.scene
    if joint not in scene.joints:
        raise UnknownNameError(
            f"joint {shown(joint)} is not in scene {scene.name!r}; one of `scene.joints` is needed, which has "
            f"{len(scene.joints)}"
        )
    number = scene.joints.index(joint)
    system = _System(solution, _together(solution, number))
    return system.found(system.column(number, 0))


def _together(solution: Any, number: int) -> list[int]:
    """Joints that share a place or a rigid body, directly or through others, with one."""
    scene = solution.scene
    sets = Sets[tuple[str, Any]]()
    for k, joint in enumerate(scene.joints):
        for holder in _holders(solution, joint):
            sets.unite(("joint", k), holder)
    root = sets.of(("joint", number))
    return [k for k in range(len(scene.joints)) if sets.of(("joint", k)) == root]


def _holders(solution: Any, joint: Joint) -> Iterator[tuple[str, Any]]:
    """Places of beams that bend, and whole rigid bodies, that a joint acts on."""
    for place in map(solution.scene.place, joint.ends):
        yield (place.body.name, "") if is_rigid(solution, place.body) else place.end
    if isinstance(joint, Guide) and joint.body is not None:
        yield joint.body, ""


@dataclass
class _System:
    """Linear equations of the unknown reactions of some joints, at all outputs.

    A moment counts in units of the scene's length, so that all unknowns are forces.
    """

    solution: Any
    joints: Sequence[int]
    columns: dict[tuple[int, int], int] = field(init=False)
    rows: list[tuple[list[tuple[int, Array]], Array, float | None]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        scene = self.solution.scene
        self.length, self.outputs = scene.length, len(self.solution.t)
        pairs = [(k, p) for k in self.joints for p in range(len(scene.joints[k].ends))]
        self.columns = {pair: 3 * c for c, pair in enumerate(pairs)}
        holders: dict[tuple[str, Any], list[tuple[int, int]]] = {}
        for k in self.joints:
            joint = scene.joints[k]
            for p, holder in enumerate(_holders(self.solution, joint)):
                holders.setdefault(holder, []).append((k, p))
            self._joint(k, joint)
        for (name, key), held in holders.items():
            if key == "":
                self._body(name, held)
            else:
                self._end(scene.place((name, key) if not isinstance(key, str) else f"{name}.{key}"), held)

    def column(self, number: int, place: int) -> int:
        """First unknown of a joint's place."""
        return self.columns[number, place]

    def found(self, column: int) -> Array:
        """Force and moment of three unknowns, (n, 3)."""
        size = 3 * len(self.columns)
        matrix = np.zeros((self.outputs, len(self.rows), size))
        right = np.zeros((self.outputs, len(self.rows)))
        for r, (terms, value, _) in enumerate(self.rows):
            for c, factor in terms:
                matrix[:, r, c] += factor
            right[:, r] = value
        weights, out = self._weights(), np.empty((self.outputs, 3))
        for n in range(self.outputs):
            _, sizes, V = np.linalg.svd(matrix[n])
            rank = int((sizes > NONE * sizes[0]).sum())
            if np.abs(V[rank:, column : column + 3]).max(initial=0.0) > UNKNOWN:
                raise ResultError(
                    "joints of rigid bodies are redundant here: equilibrium does not determine how they share their "
                    "forces; a flexible body is needed among them"
                )
            out[n] = _solved(weights[:, None] * matrix[n], weights * right[n], rank)[column : column + 3]
        return out * [1.0, 1.0, self.length]

    def _weights(self) -> Array:
        """Of the equations, (rows,)."""
        exact = EXACT * max((weight for *_, weight in self.rows if weight is not None), default=1.0)
        return np.array([exact if weight is None else weight for *_, weight in self.rows])

    def _add(self, terms: list[tuple[int, Any]], value: Any = 0.0, weight: float | None = None) -> None:
        """An equation, with its weight; without it, it has no error."""
        factors = [(c, np.asarray(f, dtype=float)) for c, f in terms]
        self.rows.append((factors, np.asarray(value, dtype=float), weight))

    def _sum(
        self,
        pairs: Sequence[tuple[int, int]],
        component: int,
        value: Any = 0.0,
        weight: float | None = None,
    ) -> None:
        self._add([(self.columns[pair] + component, 1.0) for pair in pairs], value, weight)

    def _joint(self, k: int, joint: Joint) -> None:
        """What a joint leaves free, and that it keeps nothing for itself."""
        pairs = [(k, p) for p in range(len(joint.ends))]
        match joint:
            case Pin():
                for pair in pairs:
                    self._sum([pair], 2)
            case Weld():
                self._sum(pairs, 2)
            case Clamp():
                return
            case Slider() | Prismatic():
                if joint.position is None:
                    direction = self._direction(joint)
                    self._add([(self.columns[k, 0] + c, direction[:, c]) for c in (0, 1)])
                if not joint.holds_direction:
                    self._sum(pairs, 2)
                return
            case _:
                raise unknown_kind("joint", joint, JOINTS)
        if not joint.grounded:
            self._sum(pairs, 0)
            self._sum(pairs, 1)

    def _direction(self, guide: Slider | Prismatic) -> Array:
        """Of a guide's line at each output, (n, 2)."""
        x, y = guide.direction
        fixed = guide.body is None
        angle = np.zeros(self.outputs) if fixed else turn_since_placed(self.solution, f"{guide.body}.center")
        return np.stack(
            [x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)], axis=1
        )

    def _end(self, place: Place, held: Sequence[tuple[int, int]]) -> None:
        """At a place of a beam: what holds it is known."""
        name, key = place.body.name, float(place.key)
        count = element_count(self.solution, name)
        node = round(key * count)
        parts = [
            HeldElement(self.solution, name, node - 1 + s).at_node(1 - s)
            for s in (0, 1)
            if 0 <= node - 1 + s < count
        ]
        force, moment = (sum(part[k] for part in parts) for k in (0, 1))
        beam = self.solution.scene.beam(name)
        mass, length = len(parts) * beam.mass / count, beam.length / count
        for c in (0, 1):
            self._sum(held, c, force[:, c], mass**-0.5)  # type: ignore[index]
        self._sum(held, 2, moment / self.length, self.length / length * (mass / 12.0) ** -0.5)

    def _body(self, name: str, held: Sequence[tuple[int, int]]) -> None:
        """Of a rigid body, a beam without strain or a point mass: what holds it is known."""
        solution = self.solution
        center, force, moment = holding(solution, name)
        terms: list[list[tuple[int, Any]]] = [[], [], []]
        for k, p in held:
            ends = solution.scene.joints[k].ends
            sign, end = (1.0, p) if p < len(ends) else (-1.0, 0)  # a guide's body gets the opposite
            arm = solution.position(ends[end]) - center
            column = self.columns[k, end]
            for c in (0, 1):
                terms[c].append((column + c, sign))
            terms[2] += [
                (column, -sign * arm[:, 1] / self.length),
                (column + 1, sign * arm[:, 0] / self.length),
                (column + 2, sign),
            ]
        body = solution.scene.body(name)
        for c in (0, 1):
            self._add(terms[c], force[:, c], body.mass**-0.5)
        if moment is not None:
            self._add(terms[2], moment / self.length, self.length * inertia_of(body) ** -0.5)
        else:
            for k, p in held:
                self._sum([(k, p)], 2)


def _solved(matrix: Array, right: Array, rank: int) -> Array:
    """Least squares by rows that may differ by many powers of ten, and that tell a part of the unknowns only.

    The largest rows come first, and columns are chosen: so no small row loses its digits beside large ones (Cox and
    Higham, Numer. Math. 78, 1998, 537-555). Unknowns that nothing tells are 0.
    """
    order = np.argsort(-np.abs(matrix).max(axis=1), kind="stable")
    Q, R, chosen = scipy.linalg.qr(matrix[order], mode="economic", pivoting=True)
    found = np.zeros(matrix.shape[1])
    found[chosen[:rank]] = scipy.linalg.solve_triangular(R[:rank, :rank], (Q.T @ right[order])[:rank])
    return found
