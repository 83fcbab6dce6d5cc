"""The state in which a motion starts: from the bodies' velocities, or from an equilibrium."""

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.integrators.accelerations import factorize_mass, solve_accelerations
from anctmm.integrators.state import State, new_state
from anctmm.kernels.options import kernel
from anctmm.model.bodies import Beam
from anctmm.model.connectors import RotationalSpring, ends_of
from anctmm.model.joints import drive_of
from anctmm.model.places import Place
from anctmm.results.fields import HermiteField, RigidField
from anctmm.results.solution import Solution
from anctmm.system.acting import TURN
from anctmm.system.body_meshes import RigidMesh
from anctmm.system.calls import set_jacobian
from anctmm.system.forces import place_driven, set_forces
from anctmm.system.system import System
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]

NEEDED = "start needs a Solution of solve_static of the same bodies, joints, mesh and elements"
#: Statuses of equilibria that are whole.
WHOLE = ("ok", "unstable", "singular", "imprecise")


def started(system: System, start: Solution | None = None) -> State:
    """The state at t = 0, with its accelerations; velocities are the nearest that rows and drives allow.

    Raises
    ------
    DiscretisationError
        If `start` is no equilibrium of the scene's bodies and joints, mesh and elements.
    """
    q, v = system.start()
    if start is not None:
        check_start(system, start)
        q = coordinates_of(system, start, -1)
        if system.mesh.dim == 2:
            set_angles(system, start)
    state = new_state(system, q, v)
    inputs = system.inputs(np.zeros(1))
    for _ in range(2):  # the second takes off what the regularisation leaves
        balance(system.size, system.space, system.tables, state, inputs, 0)
    state.counts[:] = 0, 1, 1, 0
    return state


@kernel
def balance(
    size: tuple[int, ...],
    space: tuple[int, ...],
    tables: Tables,
    state: State,
    inputs: Inputs,
    n: int,
) -> None:
    """Accelerations w and a of the state, from the equations of motion; the matrix is that of the mass then."""
    signals = inputs.signals[n]
    state.w[:] = 0.0
    place_driven(tables.driven, signals, state.q, state.v, state.w)
    set_jacobian(tables, state.q, signals)
    factorize_mass(size, space, tables, state, inputs, n)
    set_forces(space, tables, state.q, state.v, inputs, n, state.f)
    solve_accelerations(size, space, tables, state, signals)
    for k in range(state.w.shape[0]):
        for i in range(state.w.shape[1]):
            state.a[k, i] = state.w[k, i]
    state.counts[2] = 1


def check_start(system: System, rest: object) -> None:
    """Refuse what a motion cannot start from.

    Raises
    ------
    DiscretisationError
    """
    if not isinstance(rest, Solution):
        raise DiscretisationError(f"start is {shown(rest)}; {NEEDED}")
    scene, name = system.scene, f"start of scene {rest.scene.name!r}"
    if rest.stable is None or not len(rest.t):
        raise DiscretisationError(f"{name} is no static equilibrium of ANC-TMM; {NEEDED}")
    if rest.status.code not in WHOLE:
        raise DiscretisationError(f"{name} ended with {rest.status.code!r} ({rest.status.message}); {NEEDED}")
    for what in ("bodies", "joints"):
        if getattr(rest.scene, what) != getattr(scene, what):
            raise DiscretisationError(f"{name} has other {what} than scene {scene.name!r}; {NEEDED}")
    assert rest.run is not None  # statics have one
    there = rest.run.of(rest.scene)
    for beam, (elements, kind) in system.run.of(scene).items():
        if there[beam] != (elements, kind):
            raise DiscretisationError(
                f"{name} has body {beam!r} cut into {there[beam][0]} elements {there[beam][1]!r}, and the run into "
                f"{elements} elements {kind!r}; {NEEDED}"
            )


def rests(system: System, start: Solution | None) -> bool:
    """Whether a scene does not move: from a stable equilibrium under its whole load, which does not vary."""
    if start is None or start.stable is None:
        return False
    scene = system.scene
    driven = any(drive_of(joint) is not None for joint in scene.joints)
    varied = any(callable(load.value) for load in scene.loads) or any(
        c.law is not None for c in scene.connectors
    )
    varied |= any(callable(getattr(c, "length", None) or getattr(c, "angle", None)) for c in scene.connectors)
    same = all(
        getattr(start.scene, what) == getattr(scene, what) for what in ("loads", "gravity", "connectors")
    )
    pushed = driven or varied or any(body.moving for body in scene.bodies)
    return bool(same and not pushed and start.status.ok and start.stable[-1] and start.t[-1] == 1.0)


def coordinates_of(system: System, solution: Solution, k: int) -> Array:
    """Coordinates of output k of a solution of the same bodies, mesh and elements, (rows, nodes)."""
    mesh, found = system.mesh, dict[str, Array]()
    for name, body in mesh.bodies.items():
        field = solution.fields[name]
        assert isinstance(field, HermiteField | RigidField)  # what ANC-TMM gives
        x = field.coordinates[k]
        if isinstance(body, RigidMesh):
            x = _of_rigid(body, *_center_and_turn(body, x))
        found[name] = x.reshape(-1, x.shape[-1])[: body.nodes * body.vectors]
    return mesh.flat(found)


def _center_and_turn(body: RigidMesh, x: Array) -> tuple[Array, Array]:
    """Centre and the vector that is (1, 0) in the reference, from r and t, or from both ends of a bar."""
    if not isinstance(body.body, Beam):
        return x[0], x[1]
    c, s = np.cos(body.body.angle), np.sin(body.body.angle)
    along = x[0, 1]
    return 0.5 * (x[0, 0] + x[1, 0]), np.array([c * along[0] + s * along[1], c * along[1] - s * along[0]])


def _of_rigid(body: RigidMesh, center: Array, turn: Array) -> Array:
    """Coordinates of its node, (2, 2)."""
    if body.anchors is None:
        return np.array([center, turn])
    across = np.array([-turn[1], turn[0]])
    arms = [point - body.center for point in body.anchors]
    return np.array([center + x * turn + y * across for x, y in arms])


def set_angles(system: System, start: Solution) -> None:
    """Give rotational springs the whole turns of an equilibrium."""
    acting, turns = system.tables.acting, start.whole_turns
    for n, connector in enumerate(system.scene.connectors):
        if acting.kind[n] == TURN and isinstance(connector, RotationalSpring):
            first, second = ends_of(system.scene, connector)
            angle = (
                _angle(turns, second) - _angle(turns, first)
                if isinstance(second, Place)
                else _angle(turns, first)
            )
            acting.now[n, 1] = angle


def _angle(turns, place: Place) -> float:  # type: ignore[no-untyped-def]
    return float(turns.angle(place.body.name, place.key)[-1])
