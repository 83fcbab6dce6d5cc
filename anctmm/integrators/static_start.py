"""Start of a run from a static equilibrium."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain, Start
from anctmm.discretise.turning import angles_of_nodes
from anctmm.errors import DiscretisationError, shown
from anctmm.forces.connectors import driven_connectors, has_clock
from anctmm.model.joints import drive_of
from anctmm.model.scene import Scene
from anctmm.results.fields import HermiteField, RigidField
from anctmm.results.solution import Solution
from anctmm.results.whole_turns import WholeTurns

Array = NDArray[np.float64]

NEEDED = "start needs a Solution of solve_static of the same bodies, joints, mesh and elements"
#: Statuses of equilibria that are whole.
WHOLE = ("ok", "unstable", "singular", "imprecise")


def started(chain: Chain, rest: object) -> Chain:
    """A scene that starts from an equilibrium.

    Loads, gravity and connectors may be others than those of the equilibrium, as where a load is let go.

    Parameters
    ----------
    chain : Chain
    rest : Solution
        Of `solve_static`; its last output is taken.

    Raises
    ------
    DiscretisationError
        If it is none, or of other bodies or joints, another mesh or other elements.
    """
    if not isinstance(rest, Solution):
        raise DiscretisationError(f"start is {shown(rest)}; {NEEDED}")
    name = f"start of scene {rest.scene.name!r}"
    if rest.stable is None or not len(rest.t):
        raise DiscretisationError(f"{name} is no static equilibrium of ANC-TMM; {NEEDED}")
    if rest.status.code not in WHOLE:
        raise DiscretisationError(f"{name} ended with {rest.status.code!r} ({rest.status.message}); {NEEDED}")
    for what in ("bodies", "joints"):
        if getattr(rest.scene, what) != getattr(chain.scene, what):
            raise DiscretisationError(f"{name} has other {what} than scene {chain.scene.name!r}; {NEEDED}")
    _check_cut(name, chain, rest)
    start = Start(coordinates_of(chain, rest, -1), turned_at_end(chain, rest), _rests(chain.scene, rest))
    return replace(chain, start=start)


def _rests(scene: Scene, rest: Solution) -> bool:
    """Whether a scene does not move from an equilibrium: a stable one under its whole load, which does not vary."""
    assert rest.stable is not None
    driven = any(drive_of(joint) is not None for joint in scene.joints)
    varied = driven_connectors(scene) or has_clock(scene) or any(callable(load.value) for load in scene.loads)
    pushed = driven or varied or any(body.moving for body in scene.bodies)
    same = all(
        getattr(rest.scene, what) == getattr(scene, what) for what in ("loads", "gravity", "connectors")
    )
    return bool(same and not pushed and rest.status.ok and rest.stable[-1] and rest.t[-1] == 1.0)


def _check_cut(name: str, chain: Chain, rest: Solution) -> None:
    assert rest.run is not None  # solve_static sets it
    here, there = chain.run.of(chain.scene), rest.run.of(rest.scene)
    for beam, (elements, kind) in here.items():
        if there[beam] != (elements, kind):
            raise DiscretisationError(
                f"{name} has body {beam!r} cut into {there[beam][0]} elements {there[beam][1]!r}, and the run into "
                f"{elements} elements {kind!r}; {NEEDED}"
            )


def turned_at_end(chain: Chain, solution: Solution) -> Array:
    """Angles of all nodes' sections since the undeformed scene at the last output of a solution, (nodes,)."""
    return turned_of_nodes(chain, solution.whole_turns)[-1]


def turned_of_nodes(chain: Chain, turns: WholeTurns) -> Array:
    """Angles of all nodes' sections since the undeformed scene at each output, (n, nodes)."""
    angles = {name: turns.of_nodes(name) for name in turns.fields}
    return np.stack(
        [angles_of_nodes(chain, {name: at[k] for name, at in angles.items()}) for k in range(len(turns.t))]
    )


def coordinates_of(chain: Chain, solution: Solution, k: int) -> Array:
    """Coordinates of output k of a solution by ANC-TMM of the same bodies, mesh and elements, (rows, nodes)."""
    found = dict[str, Array]()
    for name, field in solution.fields.items():
        assert isinstance(field, HermiteField | RigidField)  # what ANC-TMM gives
        found[name] = field.coordinates[k] if isinstance(field, HermiteField) else field.coordinates[k][None]
    return chain.flat(found)
