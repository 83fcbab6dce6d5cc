"""The paper's method as it is printed: Zhai's steps on accelerations by transfer matrices, readable and slow.

It shares meshes and elements with the compiled equations, but neither unknowns nor elimination; so `anctmm check`
compares both with what is stored, and with each other.
"""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from anctmm.discretise.discretisation import Discretisation
from anctmm.elimination.transfer import Row, accelerations_plain, accelerations_riccati
from anctmm.model.scene import Scene
from anctmm.results.fields import beam_field
from anctmm.results.solution import Cost, Energy, Solution
from studies.regression.chain import Chain, Complex, pairs, vectors_of


def solve(scene: Scene, run: Discretisation, accelerations: Callable[[Row], Complex]) -> Solution:
    """Motion of a chain of beams by Zhai's explicit steps (Rong 2014, eq. 38).

    Initial velocities are those that bodies state; `Scene` has seen that they fit the joints and drives.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
        With integrator "zhai".
    accelerations : callable
        Of `anctmm.elimination.transfer`.

    Raises
    ------
    SolverError
        If the scene is no such chain.
    """
    chain, h, psi, phi = Chain(scene, run), run.dt, run.psi, run.phi
    q, v = chain.reference.copy(), vectors_of(chain.mesh.initial_velocity)
    kept = list[tuple[Complex, tuple[float, float, float]]]()
    before: Complex | None = None
    for step in range(run.steps + 1):
        known = chain.drive(step * h, q, v)
        a = np.empty_like(q)
        a[chain.order] = accelerations(chain.row(q, v, chain.forces(step * h, q), known)).T
        before = a if before is None else before
        if step in run.output_steps:
            kept.append((q.copy(), chain.energies(q, v)))
        q += h * v + h * h * ((0.5 + psi) * a - psi * before)
        v += h * ((1.0 + phi) * a - phi * before)
        before = a
    return _solution(chain, run, kept)


def _solution(
    chain: Chain, run: Discretisation, kept: list[tuple[Complex, tuple[float, float, float]]]
) -> Solution:
    mesh, fields = chain.mesh, {}
    for beam in mesh.beams:
        first = mesh.first[beam.body.name]
        nodes = [pairs(q[first : first + beam.nodes]).reshape(beam.nodes, -1, 2) for q, _ in kept]
        fields[beam.body.name] = beam_field(beam.kind, beam.body, np.array(nodes))
    kinetic, strain, potential = np.array([energies for _, energies in kept]).T
    energy = Energy(kinetic, strain, potential, np.full(len(kept), np.nan))
    t = run.times(run.output_steps)
    return Solution("readable", chain.scene, run, t, fields, energy, Cost(steps=run.steps))


#: By the names of their histories.
SOLVERS: Mapping[str, Callable[[Scene, Discretisation], Solution]] = {
    "transfer-plain": partial(solve, accelerations=accelerations_plain),
    "transfer-riccati": partial(solve, accelerations=accelerations_riccati),
}
