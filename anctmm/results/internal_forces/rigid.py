"""Total force of the joints on rigid bodies, point masses and beams of element "rigid"."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
from anctmm.errors import ResultError
from anctmm.model.bodies import Beam, Body
from anctmm.results.fields import HermiteField, RigidField
from anctmm.results.internal_forces.actions import actions_on, along
from anctmm.results.internal_forces.section_forces import cross

Array = NDArray[np.float64]


def is_rigid(solution: Any, body: Body) -> bool:
    """Whether a body does not bend in a solution: a beam by its element."""
    if not isinstance(body, Beam):
        return True
    return solution.run is not None and kind_of(solution.run.of(solution.scene)[body.name][1]).rigid


def inertia_of(body: Body) -> float:
    """Moment of inertia about the centre of mass of a body that does not bend, kg m²; 0 of a point mass."""
    return body.mass * body.length**2 / 12.0 if isinstance(body, Beam) else getattr(body, "inertia", 0.0)


def holding(solution: Any, name: str) -> tuple[Array, Array, Array | None]:
    """Centre of mass of a body, and the force and moment about it of all that is no load, weight or connector.

    Parameters
    ----------
    solution : Solution
    name : str
        Of a body that is rigid.

    Returns
    -------
    center : ndarray, shape (n, 2)
        m.
    force : ndarray, shape (n, 2)
        m r̈ less what acts on it, N.
    moment : ndarray, shape (n,), or None
        I θ̈ less what acts on it, N m; None of a point mass, which bears none.

    Raises
    ------
    ResultError
        If the solution has no accelerations.
    """
    body, field = solution.scene.body(name), solution.fields[name]
    known = isinstance(field, HermiteField | RigidField) and (
        field.accelerations is not None or solution.static
    )
    if not known:
        raise ResultError(
            f"reactions at {name!r} need accelerations, which solver {solution.solver!r} does not keep"
        )
    q, a = field.coordinates, field.accelerations
    a = np.zeros_like(q) if a is None else a
    if isinstance(body, Beam):  # both of its nodes have r, and r_x, a unit vector that turns with it
        center, weight = field.position(0.5), body.length * along(solution, name)
        force, turning = body.mass * a[:, :, 0].mean(axis=1) - weight, cross(q[:, 0, 1], a[:, 0, 1])
    else:
        factor = solution.t if solution.static else np.ones(len(q))
        center = q[:, 0]
        force, turning = (
            body.mass * (a[:, 0] - np.outer(factor, solution.scene.gravity)),
            cross(q[:, -1], a[:, -1]),
        )
    inertia = inertia_of(body)
    moment = inertia * turning
    for action in actions_on(solution, name):
        force = force - action.force
        moment = moment - action.moment - cross(field.position(action.place.key) - center, action.force)
    return center, force, moment if inertia else None
