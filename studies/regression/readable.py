"""The paper's method as it is printed: Zhai's steps on accelerations by transfer matrices, readable and slow.

Elements, damping and transfer, along one chain or through a tree, are those in their readable form, which the compiled
kernels are twins of. So `anctmm check` compares both with what is stored, and with each other.
"""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import unknown_kind
from anctmm.forces.actuation import Actuation
from anctmm.model.loads import LOADS
from anctmm.model.needs import not_offered
from anctmm.model.scene import Force, LineLoad, Scene, Torque
from anctmm.recursion.transfer import Row, accelerations_plain, accelerations_riccati, row_of
from anctmm.recursion.tree_transfer import accelerations_tree
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Cost, Energy, Solution

Array = NDArray[np.float64]
#: Accelerations of a chain at coordinates under external forces, where those of driven clamps are known.
Method = Callable[[Chain, Array, Array, Array], NDArray[np.complex128]]


def solve(scene: Scene, run: Discretisation, accelerations: Method) -> Solution:
    """Motion of a scene of one kind of element, explicitly.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
        With integrator "zhai".
    accelerations : callable
        Of `anctmm.recursion.transfer`, for one chain, or of `tree_transfer`.

    Raises
    ------
    SolverError
        If the readable form does not know such a scene.
    """
    chain = Chain(scene, run)
    q, v = chain.bodies.reference(), chain.initial_velocity()
    kept: list[tuple[Array, float, float]] = []
    before: Array | None = None
    h, psi, phi = run.dt, run.psi, run.phi
    for step in range(run.steps + 1):
        known = _drive(chain, step * h, q, v)
        answer = accelerations(chain, q, _forces(chain, step * h, q, v), known)
        a = np.stack([answer.real, answer.imag], axis=1).reshape(q.shape)
        before = a if before is None else before
        if step in run.output_steps:
            kept.append((q.copy(), *_energies(chain.bodies, q, v)))
        q += h * v + h * h * ((0.5 + psi) * a - psi * before)
        v += h * ((1.0 + phi) * a - phi * before)
        before = a
    return _solution(chain, kept)


def _drive(chain: Chain, t: float, q: Array, v: Array) -> Array:
    """Put the driven nodes where their clamps are; their accelerations."""
    known, reference = np.zeros_like(q), chain.bodies.reference()
    for end, clamp in Actuation(chain.scene, chain.bodies).driven:
        assert clamp.angle is not None
        node = chain.node(end)
        angle, rate, acceleration = (float(x) for x in clamp.angle(t))
        for k in range(2, len(q), 2):
            g = complex(*reference[k : k + 2, node]) * np.exp(1j * angle)
            for out, factor in ((q, 1.0), (v, 1j * rate), (known, 1j * acceleration - rate**2)):
                out[k : k + 2, node] = (factor * g).real, (factor * g).imag
    return known


def _forces(chain: Chain, t: float, q: Array, v: Array) -> Array:
    """External forces and damping forces, (rows, nodes)."""
    bodies, scene = chain.bodies, chain.scene
    f = bodies.weight()
    for load in scene.loads:
        if isinstance(load, LineLoad):
            raise not_offered(load)
        body, side = scene.body_end(load.end)
        node = bodies.node(body.name, side)
        match load:
            case Force():
                f[:2, node] += load.value(t) if callable(load.value) else load.value
            case Torque():
                moment = load.value(t) if callable(load.value) else load.value
                row = bodies.turning_row(body.name)
                x, y = q[row : row + 2, node]
                f[row : row + 2, node] += moment / (x * x + y * y) * np.array([-y, x])
            case _:
                raise unknown_kind("load", load, LOADS)
    for b, mesh in enumerate(bodies.meshes):
        for i in range(bodies.first[b], bodies.first[b + 1] - 1) if mesh.element.damping else ():
            ends = slice(i, i + 2)
            place, speed = (x[:, ends].T.reshape(-1, 2) for x in (q, v))
            f[:, ends] -= mesh.element.damping_force(place, speed).reshape(2, -1).T
    return f


def _energies(bodies: Bodies, q: Array, v: Array) -> tuple[float, float]:
    """Kinetic and strain energy, J."""
    kinetic = strain = 0.0
    for b, mesh in enumerate(bodies.meshes):
        for i in range(bodies.first[b], bodies.first[b + 1] - 1):
            place, speed = (x[:, i : i + 2].T.reshape(-1, 2) for x in (q, v))
            kinetic += 0.5 * float(np.sum(speed * (mesh.element.mass @ speed)))
            strain += mesh.element.energy(place)
    return kinetic, strain


def _solution(chain: Chain, kept: list[tuple[Array, float, float]]) -> Solution:
    run, scene = chain.run, chain.scene
    q, kinetic, strain = (np.array(x) for x in zip(*kept, strict=True))
    fields = {
        name: HermiteField(coordinates, scene.beam(name).length)
        for name, coordinates in chain.bodies.by_body(q).items()
    }
    potential = -np.einsum("kn,okn->o", chain.dead_load, q - chain.bodies.reference())
    energy = Energy(kinetic, strain, potential, np.full(len(q), np.nan))
    t = run.times(run.output_steps)
    return Solution("readable", scene, run, t, fields, energy, Cost(steps=run.steps), dofs=chain.dofs)


def _of_row(method: Callable[[Row], NDArray[np.complex128]]) -> Method:
    """A method for one chain."""
    return lambda chain, q, f, known: method(row_of(chain, q, f, known))


#: By the names of their histories: those for one chain, and that for trees.
SOLVERS: Mapping[str, Callable[[Scene, Discretisation], Solution]] = {
    "transfer-plain": partial(solve, accelerations=_of_row(accelerations_plain)),
    "transfer-riccati": partial(solve, accelerations=_of_row(accelerations_riccati)),
    "transfer-tree": partial(solve, accelerations=accelerations_tree),
}
