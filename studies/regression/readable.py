"""The paper's method as it is printed: Zhai's steps on accelerations by transfer matrices, readable and slow.

It shares meshes and elements with the compiled equations, but neither unknowns nor elimination; so `anctmm check`
compares both with what is stored, and with each other. Vectors of the plane are complex numbers, x + iy; those of all
nodes are arrays (nodes, k), numbered as in `Mesh`.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import KINDS, flexible
from anctmm.elimination.transfer import (
    CLAMPED,
    FREE,
    PINNED,
    Body,
    Row,
    accelerations_plain,
    accelerations_riccati,
    row_of,
)
from anctmm.errors import SolverError
from anctmm.model.joints import Clamp, Joint, Pin, Weld
from anctmm.model.loads import Force, Torque, varies
from anctmm.model.scene import Scene
from anctmm.results.fields import beam_field
from anctmm.results.solution import Cost, Energy, Solution
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
        beams = len(kinds) == 1 and kinds <= set(HELD) and len(scene.beams) == len(scene.bodies)
        layout = _layout(scene) if beams and scene.dim == 2 and _known_loads(scene) else None
        if layout is None:
            raise SolverError(f"scene {scene.name!r} is no chain for transfer matrices; {ALLOWED}")
        self.scene, self.mesh = scene, Mesh(scene, run)
        self.sides, self.links, self.supports = layout
        parts = np.split(np.arange(self.mesh.nodes), [*self.mesh.first.values()][1:])
        self.order = np.concatenate([p[::-1] if s else p for p, s in zip(parts, self.sides, strict=True)])
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
    names, last = [body.name for body in scene.bodies], len(scene.bodies) - 1
    held: dict[tuple[int, Any], Joint] = {}
    links: list[tuple[int, int, Any, Any, Joint]] = []
    for joint in scene.joints:
        at = sorted((names.index(place.body.name), place.key) for place in map(scene.place, joint.places))
        if len(at) == 2 and isinstance(joint, Pin | Weld):
            links.append((at[0][0], at[1][0], at[0][1], at[1][1], joint))
        elif len(at) == 1 and isinstance(joint, Pin | Clamp) and at[0] not in held:
            held[at[0]] = joint
        else:
            return None
    links.sort(key=lambda link: link[0])
    sides = [1 - links[0][2] if links else 0, *(link[3] for link in links)]
    neighbours = [link[:2] for link in links] == [(b, b + 1) for b in range(last)]
    passed = all(link[2] == 1 - side for link, side in zip(links, sides, strict=False))
    ends = (0, sides[0]), (last, 1 - sides[-1])
    plain = not any(getattr(joint, "stretch", "held") == "free" for joint in scene.joints)
    grounded = any(link[4].grounded or getattr(link[4], "angle", None) for link in links)
    if not (neighbours and passed and plain and not grounded and {*held} <= {*ends}):
        return None
    return [int(side) for side in sides], [link[4] for link in links], [held.get(end) for end in ends]


def _known_loads(scene: Scene) -> bool:
    """Whether nothing acts but what `Chain.forces` knows."""
    return not scene.connectors and all(
        isinstance(load, Force | Torque)
        and not getattr(load, "follower", False)
        and not scene.place(load.end).interior
        for load in scene.loads
    )


def vectors_of(flat: Array) -> Complex:
    """Vectors of all nodes, (nodes, k), from (rows, nodes)."""
    return (flat[::2] + 1.0j * flat[1::2]).T.copy()


def pairs(z: Complex) -> Array:
    """Components of the vectors of some nodes, (nodes · k, 2)."""
    return np.stack([z.real, z.imag], axis=-1).reshape(-1, 2)


def solve(scene: Scene, run: Discretisation, accelerations: Callable[[Row], Complex]) -> Solution:
    """Motion of a chain of beams by Zhai's explicit steps (Rong 2014, eq. 38); SolverError if it is no such chain.

    Initial velocities are those that bodies state; `Scene` has seen that they fit the joints and drives.
    """
    chain, h, psi, phi = Chain(scene, run), run.dt, run.psi, run.phi
    q, v = chain.reference.copy(), vectors_of(chain.mesh.initial_velocity)
    positions, energies = list[Complex](), list[tuple[float, float, float]]()
    before: Complex | None = None
    for step in range(run.steps + 1):
        known = chain.drive(step * h, q, v)
        a = np.empty_like(q)
        a[chain.order] = accelerations(chain.row(q, v, chain.forces(step * h, q), known)).T
        before = a if before is None else before
        if step in run.output_steps:
            positions.append(q.copy())
            energies.append(chain.energies(q, v))
        q += h * v + h * h * ((0.5 + psi) * a - psi * before)
        v += h * ((1.0 + phi) * a - phi * before)
        before = a
    fields = {}
    for beam in chain.mesh.beams:
        first = chain.mesh.first[beam.body.name]
        nodes = [pairs(q[first : first + beam.nodes]).reshape(beam.nodes, -1, 2) for q in positions]
        fields[beam.body.name] = beam_field(beam.kind, beam.body, np.array(nodes))
    kinetic, strain, potential = np.array(energies).T
    energy = Energy(kinetic, strain, potential, np.full(len(positions), np.nan))
    t = run.times(run.output_steps)
    return Solution("readable", chain.scene, run, t, fields, energy, Cost(steps=run.steps))


#: By the names of their histories.
SOLVERS: Mapping[str, Callable[[Scene, Discretisation], Solution]] = {
    "transfer-plain": partial(solve, accelerations=accelerations_plain),
    "transfer-riccati": partial(solve, accelerations=accelerations_riccati),
}
