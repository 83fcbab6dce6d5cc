"""The paper's method as it is printed: Zhai's steps on accelerations by transfer matrices, readable and slow.

It shares meshes and elements with the compiled equations, but neither unknowns nor elimination; so `anctmm check`
compares both with what is stored, and with each other. Vectors of the plane are complex numbers, x + iy; those of all
nodes are arrays (nodes, k), numbered as in `Mesh`.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elimination import transfer
from anctmm.elimination.transfer import Body, Row, row_of
from anctmm.model.joints import Clamp, Pin, Weld
from anctmm.model.loads import Torque
from anctmm.model.scene import Scene
from anctmm.results.fields import beam_field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.system.acting import dead_forces
from anctmm.system.mesh import Mesh

Array = NDArray[np.float64]
Complex = NDArray[Any]
#: What holds an end of a chain.
HELD: Mapping[type, str] = {Pin: transfer.PINNED, Clamp: transfer.CLAMPED}


class Chain:
    """A chain of beams of one kind of element, in their order, each passed from its start or from its end.

    Each is joined to the next by one Pin or Weld of two ends, neither grounded nor driven; a Pin, a Clamp or nothing
    holds the outer ends, and all stretches are held; nothing acts but gravity, and on ends Torques and Forces that do
    not follow. What else a scene has is left out.
    """

    def __init__(self, scene: Scene, run: Discretisation) -> None:
        self.scene, self.mesh = scene, Mesh(scene, run)
        number, last = {body.name: n for n, body in enumerate(scene.bodies)}, len(scene.bodies) - 1
        placed = [map(scene.place, joint.places) for joint in scene.joints]
        ends: list[Any] = [sorted((number[place.body.name], place.key) for place in two) for two in placed]
        links = sorted((places, n) for n, places in enumerate(ends) if len(places) == 2)
        held = {places[0]: scene.joints[n] for n, places in enumerate(ends) if len(places) == 1}
        self.links = [scene.joints[n] for _, n in links]
        #: Inboard side of each body: 0 start, 1 end.
        self.sides = [1 - links[0][0][0][1] if links else 0, *(places[1][1] for places, _ in links)]
        self.supports = [held.get(end) for end in ((0, self.sides[0]), (last, 1 - self.sides[-1]))]
        parts = np.split(np.arange(self.mesh.nodes), [*self.mesh.first.values()][1:])
        self.order = np.concatenate([p[::-1] if s else p for p, s in zip(parts, self.sides, strict=True)])
        self.reference = vectors_of(self.mesh.reference)

    def forces(self, t: float, q: Complex) -> Complex:
        """External forces at t, (nodes, k)."""
        every: Any = self.scene.loads
        loads = [replace(x, value=x.value(t)) if callable(x.value) else x for x in every]
        f = vectors_of(dead_forces(self.mesh, loads))
        for torque in (load for load in loads if isinstance(load, Torque)):
            body, side = self.scene.body_end(torque.end)
            beam = self.mesh.beams[self.scene.beams.index(body)]
            node, turned = self.mesh.first[body.name] + side * beam.elements, beam.kind.turned_vector
            f[node, turned] += 1j * torque.value / q[node, turned].conj()  # type: ignore[operator]
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
        start, end = (HELD.get(type(joint), transfer.FREE) for joint in self.supports)
        return row_of(bodies, turns, (start, end), (known[self.order[0]], known[self.order[-1]]))


def vectors_of(flat: Array) -> Complex:
    """Vectors of all nodes, (nodes, k), from (rows, nodes)."""
    return (flat[::2] + 1.0j * flat[1::2]).T.copy()


def pairs(z: Complex) -> Array:
    """Components of the vectors of some nodes, (nodes · k, 2)."""
    return np.stack([z.real, z.imag], axis=-1).reshape(-1, 2)


def solve(scene: Scene, run: Discretisation, accelerations: Callable[[Row], Complex]) -> Solution:
    """Motion of a chain of beams by Zhai's explicit steps (Rong 2014, eq. 38).

    Initial velocities are those that bodies state; `Scene` has seen that they fit the joints and drives.
    """
    chain, h, psi, phi = Chain(scene, run), run.dt, run.psi, run.phi
    q, v = chain.reference.copy(), vectors_of(chain.mesh.initial_velocity)
    positions = list[Array]()
    before: Complex | None = None
    for step in range(run.steps + 1):
        known = chain.drive(step * h, q, v)
        a = np.empty_like(q)
        a[chain.order] = accelerations(chain.row(q, v, chain.forces(step * h, q), known)).T
        before = a if before is None else before
        if step in run.output_steps:
            positions.append(pairs(q).reshape(*q.shape, 2))
        q += h * v + h * h * ((0.5 + psi) * a - psi * before)
        v += h * ((1.0 + phi) * a - phi * before)
        before = a
    fields = {}
    for beam in chain.mesh.beams:
        first = chain.mesh.first[beam.body.name]
        nodes = np.array(positions)[:, first : first + beam.nodes]
        fields[beam.body.name] = beam_field(beam.kind, beam.body, nodes)
    t = run.times(run.output_steps)
    return Solution("readable", scene, run, t, fields, Energy.unknown(len(t)), Cost(steps=run.steps))


#: By the names of their histories.
SOLVERS: Mapping[str, Callable[[Scene, Discretisation], Solution]] = {
    "transfer-plain": partial(solve, accelerations=transfer.accelerations_plain),
    "transfer-riccati": partial(solve, accelerations=transfer.accelerations_riccati),
}
