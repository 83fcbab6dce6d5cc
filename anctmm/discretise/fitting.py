"""Initial velocities corrected to satisfy the constraints of rigid bodies and guides: the nearest in kinetic energy."""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.chain import Chain
from anctmm.discretise.joined import Joined
from anctmm.model.drives import value_at
from anctmm.model.initial_motion.least_norm import MANY, least_norm

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the largest velocity that rounding may leave.
ROUNDING = 1e-14
#: Part of a constraint that others must leave of it; less says what they say.
VOID = 1e-9


def fitting_velocity(chain: Chain) -> Array:
    """Velocities at t = 0 that joints, guides and drives allow, (rows, nodes)."""
    v = chain.initial_velocity()
    if not chain.plan.kept or not chain.kept.constraints.names:
        return v
    if not (chain.kept.constraints.drives or v.any()):  # at rest, as most scenes start
        return v
    J, missed = constraint_rates(chain, v)
    if float(np.abs(missed).max()) <= ROUNDING * float(np.abs(v).max()):
        return v
    joined = Joined(chain)
    T, J = joined.matrix, J @ joined.matrix
    mass = scipy.sparse.csc_array(T.T @ mass_matrix(chain.bodies) @ T)
    change = _least_change(mass, scipy.sparse.csr_array(J), missed)
    return v - joined.spread(change)


def _least_change(mass: "scipy.sparse.csc_array", J: "scipy.sparse.csr_array", missed: Array) -> Array:
    """The change of velocities, least in kinetic energy, by which constraints are kept as far as they can be."""
    found = least_norm(mass, J, missed) if len(missed) >= MANY else None
    if found is not None:
        return found.x
    answers = scipy.sparse.linalg.splu(mass).solve(J.T.toarray())
    S = J @ answers
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(S), np.finfo(float).tiny))
    S = S * np.outer(scale, scale)
    multipliers = scale * (np.linalg.pinv(S, rcond=VOID, hermitian=True) @ (scale * missed))
    return np.asarray(answers @ multipliers)


def constraint_rates(chain: Chain, v: Array) -> "tuple[scipy.sparse.csr_array, Array]":
    """J at t = 0, by all coordinates, and rates of the constraints at velocities v."""
    kept, found = chain.kept, chain.kept.constraints
    q, homes = chain.start_coordinates(), kept.homes
    x, rate = np.append(q[homes[0], homes[1]], 1.0), np.append(v[homes[0], homes[1]], 0.0)
    signals, rates = [1.0], [0.0]
    for drive in found.drives:
        speed = float(value_at(drive.name, drive.history, 0.0, 3)[1])
        signals += [1.0, 0.0] if drive.turns else [0.0]
        rates += [0.0, speed] if drive.turns else [speed]
    missed = np.zeros(len(found.names))
    for row, i, j, signal, factor in found.terms:
        missed[row] += factor * signals[signal] * (x[i] * rate[j] + rate[i] * x[j])
        missed[row] += factor * rates[signal] * x[i] * x[j]
    return constraint_matrix(chain, q, signals), missed


def constraint_matrix(chain: Chain, q: Array, signals: Sequence[float]) -> "scipy.sparse.csr_array":
    """J by all coordinates, at coordinates q, (rows, nodes), and signals of drives, of which the first is 1."""
    kept, found = chain.kept, chain.kept.constraints
    homes = kept.homes
    x = np.append(q[homes[0], homes[1]], 1.0)
    index = np.append(homes[0] * chain.bodies.nodes + homes[1], -1)
    entries = [
        (factor * signals[signal] * x[b], row, int(index[a]))
        for row, i, j, signal, factor in found.terms
        for a, b in ((i, j), (j, i))
        if index[a] >= 0
    ]
    values, rows, columns = np.array(entries).reshape(-1, 3).T
    shape = len(found.names), q.size
    return scipy.sparse.csr_array((values, (rows.astype(int), columns.astype(int))), shape=shape)


def mass_matrix(bodies: Bodies) -> "scipy.sparse.csc_array":
    """Mass matrix of all nodes, joints apart."""
    size = bodies.rows * bodies.nodes
    return scipy.sparse.csc_array(_mass_entries(bodies), shape=(size, size))


def full_mass_matrix(bodies: Bodies) -> Array:
    """The same with its zeros: where it is small, it is there much sooner."""
    values, places = _mass_entries(bodies)
    size = bodies.rows * bodies.nodes
    found = np.zeros((size, size), order="F")
    np.add.at(found, places, values)
    return found


def _mass_entries(bodies: Bodies) -> tuple[Array, tuple[Ints, Ints]]:
    """Its entries, and their rows and columns; those of one place add up."""
    index = np.arange(bodies.rows * bodies.nodes).reshape(bodies.rows, bodies.nodes)
    rows, columns, values, axis = [], [], [], np.arange(2)[:, None, None]
    for b, mesh in enumerate(bodies.meshes):
        # below, the axes of arrays are: x or y, element, entry of the element's mass matrix
        first = bodies.first[b] + np.arange(max(mesh.elements, 1))[:, None]
        k, n = np.nonzero(bodies.masses[b])
        rows.append(index[2 * (k % 3) + axis, first + k // 3].ravel())
        columns.append(index[2 * (n % 3) + axis, first + n // 3].ravel())
        values.append(np.broadcast_to(bodies.masses[b, k, n], (2, len(first), len(k))).ravel())
    return np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
