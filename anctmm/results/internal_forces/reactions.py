"""Reactions of joints: what they exert on the places that they hold, from the equilibrium of bodies.

A joint exerts Jᵀλ, J the derivatives of its equations by the vectors of its places and λ their multipliers. At the
nodes of a beam that joints act on, and for each rigid body, the sum of these is known: inertia and elastic forces less
all that acts otherwise. These are more equations than multipliers, and what a solution has of a body's accelerations is
not exact: an error δ of them is a force m δ in its equation, as large as all that a body of a millionth of its mass
bears. So the sum of |m r̈ − F − Jᵀλ|² / m is made the least. That is Gauss' principle of least constraint (J. reine
angew. Math. 4, 1829, 232-235), by which errors along what joints leave free are no forces. Multipliers of joints that
repeat each other are not determined; of all that balance, the least are found.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.errors import ResultError
from anctmm.model.bodies import Beam, Body
from anctmm.model.expressions import Linearised
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER, PointMass
from anctmm.results.fields import NodalField
from anctmm.results.internal_forces.actions import actions_on, along, load_factors, moment_of
from anctmm.results.internal_forces.section_forces import HeldBeam
from anctmm.results.joint_rows import JointAtOutputs, rigid_bodies

Array = NDArray[np.float64]


def reactions_of(solution: Any) -> list[Array]:
    """What each joint exerts on its first place, force, N, and moment, N m; errors as of `Solution.reaction`."""
    rigid = rigid_bodies(solution)
    joints = [JointAtOutputs(solution, joint, rigid) for joint in solution.scene.joints]
    equations = _Equations(solution)
    rows = [[(equations.add(joint, row), row) for row in joint.rows()] for joint in joints]
    multipliers, found = equations.multipliers(), []
    nothing = np.zeros((len(solution.t), solution.scene.dim))
    for joint, own in zip(joints, rows, strict=True):
        force, moment = nothing, moment_of(nothing, nothing)
        for columns, row in own:
            for vector, slope in row.slopes.items():
                number, axis = joint.owners[vector]
                exerted = np.einsum("nr,nrc->nc", multipliers[:, columns], slope)
                if number == joint.owners[0][0]:
                    moment = moment + moment_of(joint.vectors[vector], exerted) if axis else moment
                    force = force if axis else force + exerted
        found.append(np.hstack([force, moment]))
    return found


class _Equations:
    """Equilibrium of nodes and rigid bodies, linear in the multipliers, at all outputs."""

    def __init__(self, solution: Any) -> None:
        self.solution, self.count, self.eye = solution, 0, np.eye(solution.scene.dim)
        self.beams = dict[str, HeldBeam]()
        #: First equation of each node of a beam, and rigid body; the known sum and the mass of each equation.
        self.first, self.sums, self.masses = dict[Any, int](), list[Array](), list[float]()
        self.at, self.factors = list[tuple[int, int]](), list[Array]()

    def add(self, joint: JointAtOutputs, row: Linearised) -> slice:
        """One more equation of a joint; returned are the places of its multipliers."""
        first, rows = self.count, row.value.shape[1]
        self.count += rows
        for vector, slope in row.slopes.items():
            number, axis = joint.owners[vector]
            place = joint.places[number]
            rigid = place.body.name in joint.rigid
            of = self._of_rigid(joint.vectors[vector], axis, place) if rigid else self._of_beam(axis, place)
            for equation, part in of:
                self.at += [(equation, first + k) for k in range(rows)]
                self.factors += [*(slope * part[:, None]).sum(axis=2).T]
        return slice(first, self.count)

    def _of_rigid(self, arm: Array, axis: int, place: Place) -> Iterator[tuple[int, Array]]:
        """Parts of a force on a vector of a place in the sums of forces and moments on a rigid body, (n, dim)."""
        body = place.body
        if body.name not in self.first:
            force, moment = _held(self.solution, body)
            mass, inertia = body.mass, float(inertia_of(self.solution, body).sum())
            masses = [mass] * force.shape[1] + [inertia] * moment.shape[1]
            self._begin(body.name, [*force.T, *moment.T], masses)
        first = self.first[body.name]
        if axis == 0:
            yield from enumerate(self.eye[:, None], start=first)
            arm = arm - _center(self.solution, body)
        if not isinstance(body, PointMass):  # which bears no moment
            moments = np.stack([moment_of(arm, np.broadcast_to(e, arm.shape)) for e in self.eye], axis=-1)
            yield from enumerate(np.moveaxis(moments, 1, 0), start=first + len(self.eye))

    def _of_beam(self, axis: int, place: Place) -> Iterator[tuple[int, Array]]:
        """The same in the sums of forces on the vectors of the nodes next to a place of a beam."""
        name = place.body.name
        if name not in self.beams:
            self.beams[name] = HeldBeam(self.solution, name)
        beam = self.beams[name]
        number, x = beam.element_at(float(place.key))
        weights = beam.element.turning(x)[0] if axis == 2 else beam.element.axis(x, axis)[0]
        for node, of_node in zip((number, number + 1), np.split(weights, 2), strict=True):
            if of_node.any():
                if (name, node) not in self.first:
                    sums = np.moveaxis(beam.at_node(node), 0, -1).reshape(-1, len(self.solution.t))
                    self._begin((name, node), [*sums], np.repeat(beam.mass_of(node), len(self.eye)).tolist())
                for k, part in enumerate(np.kron(of_node[:, None], self.eye)):
                    if part.any():
                        yield self.first[name, node] + k, part[None]

    def _begin(self, key: Any, sums: list[Array], masses: list[float]) -> None:
        """Write down the sums of forces on a node or a body."""
        self.first[key] = len(self.sums)
        self.sums += sums
        self.masses += masses

    def multipliers(self) -> Array:
        """All multipliers, (n, count)."""
        found = np.zeros((len(self.solution.t), self.count))
        if not self.factors:
            return found
        rows, columns = np.array(self.at).T
        factors, right, light = np.array(self.factors), np.array(self.sums), 1.0 / np.array(self.masses)
        for n in range(len(found)):
            A = scipy.sparse.csc_array((factors[:, n], (rows, columns)), shape=(len(right), self.count))
            found[n] = _least_squares(A, right[:, n], light)
        return found


def _least_squares(A: Any, right: Array, weight: Array) -> Array:
    """x of the least Σ weight (right − A x)², and of these the least: what regularisation leaves is taken off again."""
    weighted = A.T @ scipy.sparse.diags_array(weight)
    S = scipy.sparse.csc_array(weighted @ A)
    size = S.diagonal()
    soft = scipy.sparse.diags_array(np.where(size > 0.0, 1e-8 * size, 1.0))
    factors, x = scipy.sparse.linalg.splu(scipy.sparse.csc_array(S + soft)), np.zeros(len(size))
    for _ in range(6):
        x += factors.solve(weighted @ (right - A @ x))
    return x


def inertia_of(solution: Any, body: Body) -> Array:
    """Inertia I_k of each vector u_k that turns with a rigid body, kg m²: its angular momentum is Σ I_k u_k × u̇_k.

    In the plane its one vector has the moment of inertia, (1,), in space each axis ∫ x_k² dm, (3,).
    """
    if isinstance(body, Beam):
        return np.array([body.mass * body.length**2 / 12.0])
    if isinstance(body, PointMass):
        return np.empty(0)
    if body.dim == 2:
        return np.array([body.inertia])
    axes = np.array(solution.fields[body.name].axes)
    moments = np.diag(axes @ np.array(body.inertia) @ axes.T)
    return np.asarray(0.5 * moments.sum() - moments)


def _center(solution: Any, body: Body) -> Array:
    """Centre of mass, (n, dim), m."""
    return np.asarray(solution.fields[body.name].position(0.5 if isinstance(body, Beam) else CENTER))


def _held(solution: Any, body: Body) -> tuple[Array, Array]:
    """Force and moment about its centre on a rigid body of all that is no load, weight or connector.

    A point mass has no moment, (n, 0). ResultError if the solution has no accelerations.
    """
    name, field = body.name, solution.fields[body.name]
    if not isinstance(field, NodalField) or (field.accelerations is None and not solution.static):
        raise ResultError(
            f"reactions at {name!r} need accelerations, which solver {solution.solver!r} does not keep"
        )
    q, a = field.coordinates, field.accelerations
    a = np.zeros_like(q) if a is None else a
    if isinstance(body, Beam):  # both of its nodes have r, and r_x, a unit vector that turns with it
        force = body.mass * a[:, :, 0].mean(axis=1) - body.length * along(solution, name)
        q, a = q[:, 0], a[:, 0]
    else:
        force = body.mass * (a[:, 0] - np.outer(load_factors(solution), solution.scene.gravity))
    actions = list(actions_on(solution, name))
    force = force - sum(action.force for action in actions)
    if isinstance(body, PointMass):
        return force, np.empty((len(force), 0))
    second, center = inertia_of(solution, body), _center(solution, body)
    moment = sum(s * moment_of(q[:, k], a[:, k]) for k, s in enumerate(second, start=1))
    for action in actions:
        arm = field.position(action.place.key) - center
        moment = moment - action.moment - moment_of(arm, action.force)
    return force, moment
