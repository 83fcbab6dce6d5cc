"""Motions whose way is long beside what they move, such as a pendulum's: what Newton's iteration may leave in them.

What the iteration leaves of a position, x, in a step of h is an error x/h of the speed. It has one sign over many
steps, as it comes from one matrix that gets older, and a motion that goes on does not take it back: at the end T it is
an error ~ x T²/h², while displacements stay what they are. A share h/T of the tolerance is too much then, and estimates
see nothing of it: a rigid pendulum that swings by ±1.5 rad missed by 18 and 22 times the tolerance after 80 s, a point
mass that falls on a spring by 15 times after 20 s. A motion whose way will be MANY times the largest displacement, as
of four swings, is found, and the run made again with a stricter iteration (`step_control.left_by_newton`), as for
bodies that turn freely; with constraints between rigid bodies steps of generalized-α are shorter, too. What moves to
and fro for a shorter time has the steps that it had: a stricter iteration costs 1.5 times as much in the mean.

A spring whose vibrations no step resolves asks for a stricter iteration from the start: of its force, which is large,
a part is left in a direction that turns with the motion. A mass on a spring of 1e8 N/m missed by 25 times the tolerance
within 1 s, by 290 within 5 s.

So does an elastic body that drives or loads move and nothing holds: when a satellite's drives had folded its panels, it
went on turning, by up to 25 times the tolerance (18 of 140 runs above 3; now none, for 1.15 times the work).

A structure that joints hold, such as a frame, takes errors of its speed back by its stiffness: there the iteration may
leave 15 times as much by steps of second order, and 3 times by those of fourth (`restrained`). Errors of 22 random
structures, soft and stiff, on supports and clamps, were those of a strict iteration to 0.1 times the tolerance.
"""

from collections.abc import Mapping
from math import hypot, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.as_written import as_written
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined
from anctmm.model.bodies import Beam
from anctmm.model.connectors import Connector, RotationalSpring, Spring, ends_of, free_of, law_value, name_of
from anctmm.model.initial_motion.rigid_start import mobile
from anctmm.model.joints import drive_of
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.topology import GROUND, Sets, joined_bodies
from anctmm.model.velocities import Point

Array = NDArray[np.float64]

#: Way over the largest displacement that shows a motion to return, and what it will be at the end of the run where
#: errors of the speed matter.
SEEN, MANY = 2.5, 9.0
#: Angle by which the fastest vibration of springs turns in a step, rad, that resolves it.
RESOLVED = 0.5
#: Difference of lengths, relative, or of angles, rad, over which the slope of a law is found.
DIFFERENCE = 1e-6


@by_address
class Returning(NamedTuple):
    """Ways of the nodes.

    way: of each until now, m, (nodes,). last: where it was then, m, (2, nodes). known: whether the motion is known to
    return, and whether it was found in this run, (2,). resolved: length of steps that resolve the springs, s. elastic:
    whether anything is elastic.
    """

    way: Array
    last: Array
    known: NDArray[np.bool_]
    resolved: float
    elastic: bool


def new_returning(chain: Chain) -> Returning:
    """Nothing is known of the motion of a scene."""
    nodes, fastest = chain.bodies.nodes, _fastest(chain)
    elastic = bool(chain.parts.connectors) or any(beam.name not in chain.rigid for beam in chain.parts.beams)
    resolved = RESOLVED / fastest if fastest > 0.0 else inf
    return Returning(np.zeros(nodes), np.zeros((2, nodes)), np.zeros(2, np.bool_), resolved, elastic)


def restrained(chain: Chain) -> bool:
    """Whether all motion is that of elastic bodies between joints that leave no other, without drives and connectors.

    What Newton's iteration leaves of forces moves such a structure by an elastic displacement, and no further.
    """
    scene = chain.scene
    driven = any(drive_of(joint) is not None for joint in scene.joints)
    return not (driven or scene.connectors) and held(chain)


def held(chain: Chain) -> bool:
    """Whether joints and drives leave no motion but that of elastic bodies and springs, which no law moves."""
    scene = chain.scene
    return not (mobile(scene) or any(connector.law is not None for connector in scene.connectors))


def afloat(chain: Chain) -> bool:
    """Whether an elastic body is moved by drives or loads, and joined to nothing that stands still.

    Nothing takes back what Newton's iteration makes of its momentum, also when nothing acts any more.
    """
    scene, sets = chain.scene, Sets[str | None]()
    if not (scene.loads or any(drive_of(joint) is not None for joint in scene.joints)):
        return False
    for one, two in joined_bodies(scene, scene.connectors):
        sets.unite(one, two)
    still = sets.of(GROUND)
    return any(beam.name not in chain.rigid and sets.of(beam.name) != still for beam in scene.beams)


def _fastest(chain: Chain) -> float:
    """Frequency of the fastest vibration of a rigid body on a spring, rad/s: of bodies that bend estimates see more."""
    squares = [0.0]
    for connector in chain.parts.connectors:
        turns = isinstance(connector, RotationalSpring)
        ends = ends_of(chain.parts, connector)
        mobile = sum(_mobility(end, turns, chain.rigid) for end in ends if isinstance(end, Place))
        squares.append(mobile * _stiffness(as_written(chain.parts, connector), ends) if mobile > 0.0 else 0.0)
    return sqrt(max(squares))


def _stiffness(connector: Connector, ends: tuple[Place, Place | Point | None]) -> float:
    """Stiffness at the start, N/m or N m/rad."""
    law, placed = connector.law, 0.0
    if law is None:
        return connector.stiffness
    if isinstance(connector, Spring):
        (ax, ay), (bx, by) = (end.position if isinstance(end, Place) else end or (0.0, 0.0) for end in ends)
        placed = hypot(bx - ax, by - ay)
    free, _ = free_of(connector, placed, 0.0)
    x, d = placed - free, DIFFERENCE * (placed or 1.0)
    less, more = (law_value(name_of(connector), law, at, 0.0, 0.0) for at in (x - d, x + d))
    return abs(more - less) / (2.0 * d)


def _mobility(place: Place, turns: bool, rigid: Mapping[str, None]) -> float:
    """Acceleration of a place by a unit of force, 1/kg, or of its angle by a unit of moment, 1/(kg m²), at most."""
    body = place.body
    if isinstance(body, Beam):
        if body.name not in rigid:
            return 0.0
        inertia, arm = body.mass * body.length**2 / 12.0, 0.5 * body.length
    elif isinstance(body, RigidBody):
        inertia, arm = body.inertia, hypot(*body.arm(str(place.key)))
    else:
        inertia, arm = inf, 0.0
    return 1.0 / inertia if turns else 1.0 / body.mass + arm * arm / inertia


def begin_returning(returning: Returning, q: Array) -> None:
    """Start a run at coordinates q, (rows, nodes)."""
    returning.way[:], returning.last[:] = 0.0, q[:2]


def know_returning(returning: Returning) -> bool:
    """After a run that was ended: whether that was for a motion that returns, of which the next one knows."""
    found = bool(returning.known[1])
    if found:
        returning.known[:] = True, False
    return found


@inlined
def follow_returning(q, control):  # type: ignore[no-untyped-def]
    """After steps: bring the ways up to date, and see whether the motion returns."""
    returning, progress, turns = control.returning, control.progress[0], control.turns
    way, last = returning.way, returning.last
    least = control.small * control.scale[0]
    for i in range(q.shape[1]):
        dx, dy = q[0, i] - last[0, i], q[1, i] - last[1, i]
        way[i] += np.sqrt(dx * dx + dy * dy)
        last[0, i], last[1, i] = q[0, i], q[1, i]
        if turns.found[1] and not turns.found[0] and not returning.known[0]:
            moved = max(control.moved[0, i], least)
            if way[i] > SEEN * moved and way[i] * control.t_end > MANY * moved * progress:
                returning.known[1] = turns.found[2] = True
