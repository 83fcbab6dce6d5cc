"""Kernels that the solver does not share: those of the global DAE and of PyElastica, by one short run of each."""

from contextlib import suppress

import anctmm as at
from anctmm.errors import AnctmmError
from anctmm.solvers import registry
from studies.scenes import cantilever_fall

RUNS = (("global-dae", "zhai"), ("global-dae", "generalized-alpha"), ("pyelastica", "zhai"))


def compile_others():
    """Compile what has not been compiled yet."""
    scene = cantilever_fall().scene
    for name, integrator in RUNS:
        with suppress(AnctmmError):  # a solver that is not installed
            registry.solver(name)(
                scene, at.Discretisation(mesh=4, integrator=integrator, dt=1e-6, t_end=2e-6)
            )


if __name__ == "__main__":
    compile_others()
