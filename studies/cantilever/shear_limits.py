"""The limit of the paper's shear-deformable element, and its error that no mesh refinement removes."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from anctmm.model.scene import Material
from anctmm.model.sections import Rectangle
from anctmm.results.solution import Solution
from reference.exact import Rigidity, poisson_locking_factor, solve_static, timoshenko_tip_deflection
from studies.engine.runner import Runner
from studies.engine.running.trial import STATIC, Trial
from studies.engine.study import Options
from studies.engine.tables import Table
from studies.scenes import LENGTH, BaseScene, cantilever_tip_force

SMALL_LOAD = 1e-4
WARNING = (
    "Warning: with ν > 0 the shear element is too stiff in bending by (1 − ν)/((1 + ν)(1 − 2ν)), 1.346 for "
    "ν = 0.3 (Poisson locking): no mesh refinement removes it. Take ν = 0 or the cable."
)


@dataclass(frozen=True)
class Fact:
    """A limit to show.

    Parameters
    ----------
    case : str
        What is loaded how, and which component of the tip's displacement is looked at.
    base : BaseScene
    component : int
        0 along the beam, 1 across.
    over : str
        The yardstick all displacements of the table are divided by, and
    yardstick : float
        its displacement, m.
    theory : str
        What predicts the element's limit, and
    predicted : float
        its displacement over the yardstick's.
    """

    case: str
    base: BaseScene
    component: int
    over: str
    yardstick: float
    theory: str
    predicted: float

    def measure(self, solution: Solution) -> float:
        """Tip displacement under the full load over the yardstick's; NaN for a run that failed."""
        if not solution.status.ok:
            return float("nan")
        return float(solution.displacement("beam.end")[-1, self.component] / self.yardstick)


def beam(load: float, slenderness: float, poisson: float) -> BaseScene:
    """A cantilever of the given L/h and ν under a tip force."""
    section = Rectangle(0.01, LENGTH / slenderness)
    material = Material(E=1e9, density=2000.0, poisson=poisson)
    name = f"cantilever-force-{load:g}-slenderness-{slenderness:g}-poisson-{poisson:g}"
    return cantilever_tip_force(load, section, material, name)


def small_strain(poisson: float) -> Fact:
    """Small load, L/h = 10: Timoshenko's deflection with the stiffness that Poisson locking leaves."""
    base = beam(SMALL_LOAD, 10.0, poisson)
    (body,) = base.scene.beams
    force = SMALL_LOAD * body.material.E * body.section.second_moment / LENGTH**2
    stiffness = Rigidity.euler_bernoulli(body.section, body.material).bending
    euler = timoshenko_tip_deflection(LENGTH, force, stiffness, np.inf)
    shear = body.material.lame[1] * body.section.area
    predicted = timoshenko_tip_deflection(LENGTH, force, stiffness * poisson_locking_factor(poisson), shear)
    theory = "Timoshenko" if poisson == 0.0 else "Timoshenko with Poisson locking"
    case = f"ν = {poisson:g}, small load, L/h = 10"
    return Fact(case, base, 1, "Euler–Bernoulli", -euler, theory, predicted / euler)


def large_strain(component: int) -> Fact:
    """P L²/EI = 3, h/L = 1/20: Green's strain against Reissner's."""
    base = beam(3.0, 20.0, 0.0)
    green, reissner = (
        float(solve_static(base.scene, model).displacement("beam.end")[-1, component])
        for model in ("director", "reissner")
    )
    case = f"ν = 0, P L²/EI = 3, h/L = 1/20, {('along', 'across')[component]}"
    return Fact(case, base, component, "Reissner", reissner, "continuum of Green strains", green / reissner)


def shear_limits(options: Options, runner: Runner, solver: str = "anctmm") -> Table:
    """The facts, measured over meshes beside their theory."""
    sizes = (8, 32, 64) if options.quick else (1, 2, 4, 8, 16, 32, 64, 128)
    lines = []
    for fact in (small_strain(0.0), large_strain(0), large_strain(1), small_strain(0.3)):
        limit = fact.measure(solve_static(fact.base.scene, "director"))
        cases = [Trial(fact.base.scene, solver, (n,), element="shear", integrator=STATIC) for n in sizes]
        outcomes = runner.sweep(cases)
        away = [abs(fact.measure(o.solution) / limit - 1.0) for o in outcomes]
        for k, outcome in enumerate(outcomes):
            measured = fact.measure(outcome.solution)
            doubled = k > 0 and sizes[k] == 2 * sizes[k - 1]
            lines.append({
                "case": fact.case, "solver": solver, "elements": sizes[k], "tip_over": fact.over,
                "measured": measured, "theory": fact.theory, "predicted": fact.predicted,
                "off_prediction": measured / fact.predicted - 1.0, "own_limit": limit,
                "off_own_limit": away[k], "order": np.log2(away[k - 1] / away[k]) if doubled else float("nan"),
                "status": str(outcome.solution.status),
            })  # fmt: skip
    notes = (
        WARNING,
        "measured, predicted and own_limit: the tip's displacement over that of the beam in tip_over. own_limit is "
        "the exact continuum of the element's own energy; off_own_limit the relative distance to it.",
        "Second order towards its own limit at best: the director is linear over an element and cannot follow the "
        "slope of a cubic; and a clamp that also holds r_x adds a small first-order term.",
    )
    return Table("shear_limits", "What the shear-deformable element tends to", pd.DataFrame(lines), notes)
