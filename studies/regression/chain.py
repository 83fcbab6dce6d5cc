"""Scenes that are chains of beams, as the paper's transfer matrices take them.

Vectors of the plane are complex numbers, x + iy; those of all nodes are arrays (nodes, k), numbered as in `Mesh`.
"""

from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import KINDS, flexible
from anctmm.elimination.transfer import CLAMPED, FREE, PINNED, Body, Row, row_of
from anctmm.errors import SolverError
from anctmm.model.joints import Clamp, Joint, Pin, Weld
from anctmm.model.loads import Force, Torque, varies
from anctmm.model.scene import Scene
from anctmm.system.mesh import Mesh

Array = NDArray[np.float64]
Complex = NDArray[Any]
#: Inboard side of each body (0 start, 1 end), joints between neighbours, and what holds both outer ends.
Layout = tuple[list[int], list[Joint], list[Joint | None]]
#: Kinds of element of which joints hold all vectors.
HELD = tuple(name for name in flexible() if KINDS[name].held == KINDS[name].vectors)
ALLOWED = (
    f"allowed are beams of one kind of element ({' or '.join(HELD)}) in their order, each joined to the next "
    f"by one Pin or Weld of two ends, neither grounded nor driven, at the outer ends a Pin, a Clamp or nothing, all "
    f"stretches held, and on ends Torques and Forces that do not follow"
)


class Chain:
    """A scene that is a chain of beams, each passed from its start or from its end.

    Raises
    ------
    SolverError
        If it is anything else.
    """

    def __init__(self, scene: Scene, run: Discretisation) -> None:
        kinds = {kind for _, kind in run.of(scene).values()}
        alike = len(kinds) == 1 and kinds <= set(HELD) and len(scene.beams) == len(scene.bodies)
        layout = _layout(scene) if alike and scene.dim == 2 and _known_loads(scene) else None
        if layout is None:
            raise SolverError(f"scene {scene.name!r} is no chain for transfer matrices; {ALLOWED}")
        self.scene, self.mesh = scene, Mesh(scene, run)
        self.sides, self.links, self.supports = layout
        parts = np.split(np.arange(self.mesh.nodes), [*self.mesh.first.values()][1:])
        self.order = np.concatenate(
            [p[::-1] if side else p for p, side in zip(parts, self.sides, strict=True)]
        )
        self.reference, self.weight = vectors_of(self.mesh.reference), vectors_of(self.mesh.weight)

    def forces(self, t: float, q: Complex, dead: bool = False) -> Complex:
        """External forces at t, or only those that never change, (nodes, k)."""
        f = self.weight.copy()
        for load in self.scene.loads:
            if not isinstance(load, Force | Torque) or (dead and varies(load)):
                continue
            body, side = self.scene.body_end(load.end)
            beam = self.mesh.beams[self.scene.beams.index(body)]
            node, turned = self.mesh.first[body.name] + side * beam.elements, beam.kind.turned_vector
            value: Any = load.value(t) if callable(load.value) else load.value
            if isinstance(load, Force):
                f[node, 0] += complex(*value)
            else:
                f[node, turned] += 1j * value / q[node, turned].conj()
        return f

    def drive(self, t: float, q: Complex, v: Complex) -> Complex:
        """Put nodes of driven clamps where they are at t; their accelerations, (nodes, k), zero of the others."""
        known = np.zeros_like(q)
        for node, clamp in zip(self.order[[0, -1]], self.supports, strict=True):
            if isinstance(clamp, Clamp) and clamp.angle is not None:
                angle, rate, acceleration = map(float, clamp.angle(t))
                q[node, 1:] = g = self.reference[node, 1:] * np.exp(1j * angle)
                v[node, 1:], known[node, 1:] = 1j * rate * g, (1j * acceleration - rate**2) * g
        return known

    def row(self, q: Complex, v: Complex, f: Complex, known: Complex) -> Row:
        """Its transfer matrices under external forces f, with known accelerations of the outer nodes."""
        bodies, k = list[Body](), q.shape[1]
        for beam, side in zip(self.mesh.beams, self.sides, strict=True):
            first, element = self.mesh.first[beam.body.name], beam.element
            loads = np.zeros((beam.elements, 2 * k), dtype=complex)
            loads[:, :k] = f[first : first + beam.elements]
            loads[-1, k:] = f[first + beam.elements]
            for i, load in enumerate(loads, first):
                x, rate = pairs(q[i : i + 2]), pairs(v[i : i + 2])
                inner = element.force(x) + (element.damping_force(x, rate) if element.damping else 0.0)
                load -= inner @ [1.0, 1.0j]
            bodies.append(Body(element.mass, loads, side == 1))
        along = [complex(*beam.along) for beam in self.mesh.beams]
        frames = zip(along, along[1:], self.links, strict=False)
        turns = [two / one if isinstance(link, Weld) else None for one, two, link in frames]
        start, end = ({Pin: PINNED, Clamp: CLAMPED}.get(type(joint), FREE) for joint in self.supports)
        return row_of(bodies, turns, (start, end), (known[self.order[0]], known[self.order[-1]]))

    def energies(self, q: Complex, v: Complex) -> tuple[float, float, float]:
        """Kinetic and strain energy, and the potential of forces that never change, J."""
        kinetic = strain = 0.0
        for beam in self.mesh.beams:
            first = self.mesh.first[beam.body.name]
            for i in range(first, first + beam.elements):
                rate = pairs(v[i : i + 2])
                kinetic += 0.5 * float(np.sum(rate * (beam.element.mass @ rate)))
                strain += beam.element.energy(pairs(q[i : i + 2]))
        moved = self.forces(0.0, q, dead=True).conj() * (q - self.reference)
        return kinetic, strain, -float(moved.real.sum())


def _layout(scene: Scene) -> Layout | None:
    """How beams follow each other; None of what is no chain."""
    names, held, links = [body.name for body in scene.bodies], {}, defaultdict(list)
    for joint in scene.joints:
        places = [scene.place(place) for place in joint.places]
        at = sorted((names.index(place.body.name), float(place.key)) for place in places)
        match joint, [n - at[0][0] for n, _ in at]:
            case _ if any(place.interior for place in places):
                return None
            case ((Pin() | Clamp(stretch="held")), [0]):
                held[at[0]] = joint
            case ((Pin(grounded=False) | Weld(grounded=False, angle=None, stretch="held")), [0, 1]):
                links[at[0][0]].append((joint, int(at[0][1]), int(at[1][1])))
            case _:
                return None
    last = len(names) - 1
    if sorted(links) != [*range(last)] or any(len(found) > 1 for found in links.values()):
        return None
    joints, outboard, inboard = (
        zip(*(links[b][0] for b in range(last)), strict=True) if last else ((), (), ())
    )
    sides = [1 - outboard[0] if last else 0, *inboard]
    ends = (0, float(sides[0])), (last, 1.0 - sides[-1])
    if any(a == b for a, b in zip(outboard, sides, strict=False)) or not {*held} <= {*ends}:
        return None
    return sides, [*joints], [held.get(end) for end in ends]


def _known_loads(scene: Scene) -> bool:
    """Whether nothing acts but what `Chain.forces` knows."""
    known = [
        (isinstance(load, Force) and not load.follower) or isinstance(load, Torque) for load in scene.loads
    ]
    inside = (scene.place(load.end).interior for load in scene.loads if isinstance(load, Force | Torque))
    return not scene.connectors and all(known) and not any(inside)


def vectors_of(flat: Array) -> Complex:
    """Vectors of all nodes, (nodes, k), from (rows, nodes)."""
    return (flat[::2] + 1.0j * flat[1::2]).T.copy()


def pairs(z: Complex) -> Array:
    """Components of the vectors of some nodes, (nodes · k, 2)."""
    return np.stack([z.real, z.imag], axis=-1).reshape(-1, 2)
