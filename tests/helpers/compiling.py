"""Kernels that the solver does not share: those of the global DAE and of PyElastica, by one short run of each."""

from contextlib import suppress

import anctmm as at
from anctmm.errors import AnctmmError
from anctmm.solvers import registry

RUNS = (("global-dae", "zhai"), ("global-dae", "generalized-alpha"), ("pyelastica", "zhai"))


def compile_others():
    """Compile what has not been compiled yet."""
    beam = at.Beam("beam", (0, 0), (1, 0), at.Circle(0.05), at.Material(E=1e7, density=1000.0))
    scene = at.Scene("compile", [beam], [at.Clamp("beam.start")], gravity=(0, -1))
    for name, integrator in RUNS:
        with suppress(AnctmmError):  # a solver that is not installed
            registry.solver(name)(
                scene, at.Discretisation(mesh=4, integrator=integrator, dt=1e-6, t_end=2e-6)
            )


if __name__ == "__main__":
    compile_others()
