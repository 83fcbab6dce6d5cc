"""The four-bar over half a turn of its crank, for peers whose elements allow no more."""

from dataclasses import replace

from studies.engine.accuracy.dynamics import Fine, Plan, Scheme, of_kinds, sweep
from studies.engine.runner import Runner
from studies.engine.running.trial import Mesh
from studies.engine.study import Options
from studies.engine.tables import BUILD, Table
from studies.scenes import BaseScene

#: s; the crank has turned by 0.45 of a turn.
T_END = 0.95
SOLVERS = ("anctmm", "exudyn-cable", "opensees")
#: By whether the run is quick.
MESHES: dict[bool, tuple[Mesh, ...]] = {
    False: ((1, 4, 1), (2, 8, 2), (4, 16, 4), (8, 32, 8)),
    True: ((2, 8, 2), (4, 16, 4)),
}
STEPS = {False: (5e-3, 2.5e-3, 1.25e-3), True: (2.5e-3,)}
FINE = {
    False: Fine(("anctmm",), (16, 64, 16), (8, 32, 8), 1.25e-4, 2.5e-4, "generalized-alpha"),
    True: Fine(("anctmm",), (8, 32, 8), (4, 16, 4), 6.25e-4, 1.25e-3, "generalized-alpha"),
}
COLUMNS = [
    "scene", "solver", "element", "elements", "dt", "t_end", "steps", "error", "reference_error", "reference", "cpu_s",
    "build_s", "wall_s", "status",
]  # fmt: skip
NOTES = (
    f"The same scene until t = {T_END:g} s. opensees has frames that follow their chords; where a chord has turned by "
    "half a turn its angle jumps and Newton's iteration fails on every mesh: it refuses the whole turn of the other "
    "tables.",
    "Newton tolerances: the defaults of the solvers.",
    BUILD,
)


def half_turn(base: BaseScene, options: Options, runner: Runner) -> Table | None:
    """Errors and times of `SOLVERS`, or of the requested ones; None if another element or integrator is requested."""
    quick = options.quick
    scheme = Scheme("cable", "full", "generalized-alpha", SOLVERS, MESHES[quick], lambda mesh: STEPS[quick])
    if not of_kinds([scheme], options):
        return None
    swept = sweep(replace(base, t_end=T_END), Plan((scheme,), {"cable": FINE[quick]}), options, runner)
    frame = swept.frame.reindex(columns=COLUMNS)
    return Table("half_turn", "The four-bar over half a turn", frame, NOTES)
