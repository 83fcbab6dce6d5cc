"""Every study of the report in the smallest form that still runs all of its code."""

from studies.engine.study import Options

#: With runs that end well, runs that diverge and a solver that refuses.
SMALL = {
    "four-bar": Options(quick=True, meshes=((2, 8, 2),), steps=(5e-3,), solvers=("anctmm",)),
    "cantilever": Options(quick=True, meshes=((8,),), steps=(1e-2,), solvers=("anctmm",)),
    "agreement": Options(quick=True, meshes=((16,),), steps=(5e-3,), solvers=("anctmm", "global-dae", "pyelastica")),
    "trade": Options(quick=True, meshes=((1, 3, 1), (4,)), steps=(1e-2,), solvers=("anctmm",)),
    "extremes": Options(quick=True),
    "fidelity": Options(quick=True),
    "published": Options(quick=True),
}  # fmt: skip
