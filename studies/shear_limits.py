"""What the paper's shear-deformable element tends to, and what no mesh cures."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from anctmm.scene import Material
from anctmm.sections import Rectangle
from anctmm.solution import Solution
from reference.exact import Rigidity, poisson_locking_factor, solve_static, timoshenko_tip_deflection
from studies.runner import STATIC, Case, Mesh, Runner
from studies.scenes import LENGTH, BaseScene, cantilever_tip_force
from studies.study import Options
from studies.tables import Table

SMALL_LOAD = 1e-4
WARNING = (
    "Warning: with ν > 0 the shear element is too stiff in bending by (1 − ν)/((1 + ν)(1 − 2ν)), 1.346 for "
    "ν = 0.3 (Poisson locking): no mesh cures it. Take ν = 0 or the cable."
)


@dataclass(frozen=True)
class Fact:
    """A limit to show.

    Parameters
    ----------
    text : str
    base : BaseScene
    predicted : float
        Tip displacement by theory over that of the yardstick.
    yardstick : (float, float)
        The displacement everything is divided by, m.
    theory, over : str
        What `predicted` and `yardstick` are.
    """

    text: str
    base: BaseScene
    predicted: float
    yardstick: float
    theory: str
    over: str


def beam(load: float, slenderness: float, poisson: float) -> BaseScene:
    """A cantilever of the given L/h and ν under a tip force."""
    section = Rectangle(0.01, LENGTH / slenderness)
    material = Material(E=1e9, density=2000.0, poisson=poisson)
    name = f"cantilever-force-{load:g}-slenderness-{slenderness:g}-poisson-{poisson:g}"
    return cantilever_tip_force(load, section, material, name)


def small_strain(poisson: float) -> Fact:
    """Small load, L/h = 10: Timoshenko's deflection with the stiffness that Poisson locking leaves."""
    base = beam(SMALL_LOAD, 10.0, poisson)
    (body,) = base.scene.bodies
    force = SMALL_LOAD * body.material.E * body.section.second_moment / LENGTH**2
    stiffness = Rigidity.euler_bernoulli(body.section, body.material).bending
    euler = timoshenko_tip_deflection(LENGTH, force, stiffness, np.inf)
    shear = body.material.lame[1] * body.section.area
    predicted = timoshenko_tip_deflection(LENGTH, force, stiffness * poisson_locking_factor(poisson), shear)
    text = f"ν = {poisson:g}, small load, L/h = 10"
    theory = "Timoshenko" if poisson == 0.0 else "Timoshenko with Poisson locking"
    return Fact(text, base, predicted / euler, euler, theory, "Euler–Bernoulli")


def large_strain() -> Fact:
    """P L²/EI = 3, h/L = 1/20: Green's strain against Reissner's."""
    base = beam(3.0, 20.0, 0.0)
    director, reissner = (tip_of(solve_static(base.scene, model)) for model in ("director", "reissner"))
    text = "ν = 0, P L²/EI = 3, h/L = 1/20"
    return Fact(text, base, director / reissner, reissner, "exact continuum of its Green strains", "Reissner")


def tip_of(solution: Solution) -> float:
    """Displacement of the tip under the full load, m."""
    return float(np.linalg.norm(solution.displacement("beam.end")[-1]))


def shear_limits(options: Options, runner: Runner, solver: str = "anctmm") -> Table:
    """The three facts, measured over meshes beside their theory."""
    sizes = (4, 16, 64) if options.quick else (1, 2, 4, 8, 16, 32, 64, 128)
    meshes: tuple[Mesh, ...] = tuple((n,) for n in sizes)
    lines = []
    for fact in (small_strain(0.0), large_strain(), small_strain(0.3)):
        cases = [Case(fact.base.scene, solver, mesh, element="shear", integrator=STATIC) for mesh in meshes]
        for outcome in runner.sweep(cases):
            solution, ok = outcome.solution, outcome.solution.status.ok
            tip = tip_of(solution) if ok else float("nan")
            measured = tip / fact.yardstick
            lines.append({
                "case": fact.text, "solver": solver, "elements": outcome.case.mesh[0], "tip_over": fact.over,
                "measured": measured, "predicted": fact.predicted, "theory": fact.theory,
                "difference": measured / fact.predicted - 1.0, "status": str(solution.status),
            })  # fmt: skip
    notes = (
        WARNING,
        "Second order only: the director is linear over an element and cannot follow the slope of a cubic.",
        "Under large loads its strain is Green's: about 0.3 % from Reissner's beam at h/L = 1/20.",
    )
    return Table("shear_limits", "What the shear-deformable element tends to", pd.DataFrame(lines), notes)
