"""The largest stable step of the explicit schemes: measured against 2/ω_max of the linearised scene."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.linalg import eigh

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import unknown_kind
from anctmm.integrators.stability import highest_frequency, zhai_limit
from anctmm.model.loads import LOADS
from anctmm.model.needs import not_offered
from anctmm.model.scene import Beam, Clamp, Force, LineLoad, Material, Scene, Torque
from anctmm.model.sections import Rectangle
from studies.benchmark.direct import Direct, mass_matrices, stiffness_matrices
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.march import equilibrium, grows, largest_stable, options_of
from studies.extremes.parts import Job, Part, Row, off, rows_of, worst
from studies.report.plots import PALETTE, Picture, legend_below, picture

Array = NDArray[np.float64]

#: Length of the beam (m), its width, and the pull that keeps it in tension at "rest", of EA: energies of a disturbance
#: then are small beside one that is there, as they are in any real scene.
LENGTH, WIDTH, PULL = 1.0, 0.02, 1e-5
DENSITY = 1000.0
#: Steps a disturbance is given to grow in; where the method damps (ψ > ½) or growth is slow, more.
STEPS, MANY_STEPS = 1000, 4000
#: In the order of their colours.
SCHEMES = ("cable full", "shear", "cable reduced", "cable lobatto")
#: Relative width of the bisection.
WIDTH_OF_BISECTION = 2e-4


@dataclass(frozen=True)
class Setting:
    """A clamped beam, a state it is in, and a scheme.

    Parameters
    ----------
    what : str
        What is varied.
    element, quadrature : str
    elements : int
    E : float
        Pa.
    slenderness : float
        L/h.
    state : str
        Of `STATES`.
    psi : float
        ψ = φ.
    """

    what: str
    element: str = "cable"
    quadrature: str = "full"
    elements: int = 8
    E: float = 1e7
    slenderness: float = 50.0
    state: str = "at rest"
    psi: float = 0.5

    @property
    def scene(self) -> Scene:
        """The beam with the load that holds it in its state."""
        section = Rectangle(WIDTH, LENGTH / self.slenderness)
        body = Beam("beam", (0.0, 0.0), (LENGTH, 0.0), section, Material(self.E, DENSITY))
        return Scene("beam", (body,), (Clamp("beam.start"),), STATES[self.state](body))

    @property
    def run(self) -> Discretisation:
        """The scheme; its step is replaced by those that are tried."""
        return Discretisation(
            mesh=self.elements, element=self.element, quadrature=self.quadrature, integrator="zhai", psi=self.psi,
            phi=self.psi, dt=1.0, t_end=1.0,
        )  # fmt: skip

    @property
    def label(self) -> str:
        """Tells it from every other."""
        return (
            f"step, {self.what}, {self.elements} {self.element} {self.quadrature}, E {self.E:g}, L/h "
            f"{self.slenderness:g}, {self.state}, ψ {self.psi:g}"
        )


def _axial(body: Beam) -> float:
    return body.material.E * body.section.area


def _bending(body: Beam) -> float:
    return body.material.E * body.section.second_moment / body.length


STATES: dict[str, Any] = {
    "at rest": lambda b: (Force("beam.end", (PULL * _axial(b), 0.0)),),
    "pulled askew": lambda b: (Force("beam.end", (PULL * _axial(b), ASKEW * _bending(b) / b.length)),),
    "stretched by a fifth": lambda b: (Force("beam.end", (0.2 * _axial(b), 0.0)),),
    "compressed by a tenth": lambda b: (Force("beam.end", (-0.1 * _axial(b), 0.0)),),
    "bent by PL²/EI = 10": lambda b: (Force("beam.end", (0.0, -10.0 * _bending(b) / b.length)),),
    "rolled into a half circle": lambda b: (Torque("beam.end", pi * _bending(b)),),
    "rolled into a circle": lambda b: (Torque("beam.end", 2.0 * pi * _bending(b)),),
}  # fmt: skip
#: The compressed beam must be too short to buckle: its L/h.
STUBBY = 1.0


def settings(quick: bool) -> Iterator[Setting]:
    """All settings."""
    schemes = [("cable", "full"), ("cable", "reduced"), ("cable", "lobatto"), ("shear", "full")]
    for element, quadrature in schemes:
        for n in (2, 16) if quick else (1, 2, 4, 8, 16, 32, 64, 128):
            yield Setting("mesh", element, quadrature, n)
    for element in ("cable", "shear"):
        for psi in (1.0,) if quick else (0.6, 0.75, 1.0, 1.5):
            yield Setting("psi = phi", element, psi=psi)
        for E in (1e3, 1e12) if quick else (1e3, 1e6, 1e9, 1e12):
            yield Setting("stiffness", element, E=E)
        for slenderness in (1e4,) if quick else (2.0, 10.0, 100.0, 1e3, 1e4):
            yield Setting("slenderness", element, slenderness=slenderness)
        for state in list(STATES)[-1:] if quick else [s for s in STATES if s != "pulled askew"]:
            slenderness = STUBBY if state.startswith("compressed") else 50.0
            yield Setting("state", element, elements=16, state=state, slenderness=slenderness)


def frequencies(scene: Scene, run: Discretisation, q: Array) -> Array:
    """All angular frequencies of a scene linearised about q, rad/s, by a dense eigenvalue solver.

    Tangents of the elements are summed, that of torques is added: nothing of the solver's own estimate is used.
    """
    chain = Chain(scene, run)
    matrix = Direct(chain).matrix
    K, M = (
        (matrix.T @ _summed(chain, blocks) @ matrix)
        for blocks in (stiffness_matrices(chain.bodies, q), mass_matrices(chain.bodies))
    )
    for load in scene.loads:
        match load:
            case Torque():
                K += matrix.T @ _torque_stiffness(chain, load, q) @ matrix
            case Force():
                pass
            case LineLoad():
                raise not_offered(load)
            case _:
                raise unknown_kind("load", load, LOADS)
    values = eigh(K, M, eigvals_only=True)
    return np.sqrt(np.maximum(values, 0.0))


def _summed(chain: Chain, blocks: Array) -> Array:
    """Dense matrix of all nodes, joints apart, from those of the elements."""
    bodies = chain.bodies
    rows, size = bodies.rows, bodies.rows * bodies.nodes
    out, e = np.zeros((size, size)), 0
    for b, count in enumerate(bodies.elements):
        for i in range(int(bodies.first[b]), int(bodies.first[b]) + int(count)):
            at = np.concatenate([np.arange(rows) * bodies.nodes + i, np.arange(rows) * bodies.nodes + i + 1])
            out[np.ix_(at, at)] += blocks[e]
            e += 1
    return out


def _torque_stiffness(chain: Chain, torque: Torque, q: Array) -> Array:
    """Less the derivative of M (−g_y, g_x)/|g|² by the vector g that the torque turns."""
    bodies = chain.bodies
    body, side = chain.scene.body_end(torque.end)
    row, node = bodies.turning_row(body.name), bodies.node(body.name, side)
    x, y = q[row : row + 2, node]
    f = float(torque.value) / (x * x + y * y) ** 2  # type: ignore[arg-type]
    at = np.array([row, row + 1]) * bodies.nodes + node
    out = np.zeros((q.size, q.size))
    out[np.ix_(at, at)] = -f * np.array([[2.0 * x * y, y * y - x * x], [y * y - x * x, -2.0 * x * y]])
    return out


def limit_row(setting: Setting) -> list[Row]:
    """The measured limit of a setting beside its theory."""
    scene, run = setting.scene, setting.run
    q = equilibrium(scene, run, load_steps=8 if "circle" in setting.state or "bent" in setting.state else 2)
    fastest = float(frequencies(scene, run, q)[-1])
    own = highest_frequency(Chain(scene, run), q)
    predicted = zhai_limit(setting.psi, setting.psi) / fastest
    steps = STEPS if setting.psi == 0.5 else MANY_STEPS
    measured = largest_stable(
        lambda dt: grows(scene, run, q, steps, dt), 1.02 * predicted, WIDTH_OF_BISECTION
    )
    return [{
        "what": setting.what, "solver": "anctmm", **options_of(run), "elements": setting.elements, "E": setting.E,
        "slenderness": setting.slenderness, "state": setting.state, "psi": setting.psi, "omega_max": fastest,
        "measured": measured, "predicted": predicted, "difference": off(measured, predicted),
        "theory": "√(2/ψ)/ω_max", "solver_omega_off": off(own, fastest), "reference": "dense eigenvalues",
        "uncertainty": WIDTH_OF_BISECTION, "status": "ok",
    }]  # fmt: skip


#: Solvers with an explicit scheme, and the elements they have; pulled at from the start, as their states cannot be set.
SOLVERS = (
    ("anctmm", "cable"),
    ("anctmm", "shear"),
    ("global-dae", "cable"),
    ("global-dae", "shear"),
    ("exudyn-cable", "cable"),
)
#: Share of bending in that pull, of EI/L²: a straight pull would leave the thickness of shear elements at rest.
ASKEW = 1e-3
#: A displacement of so many times the one under the pull counts as grown.
FAR = 100.0


def solver_row(name: str, element: str, elements: int, runner: Runner) -> list[Row]:
    """The measured limit of a solver used through its runs only, starting from the straight beam."""
    setting = Setting("solver", element, elements=elements, state="pulled askew")
    scene, run = setting.scene, setting.run
    fastest = float(frequencies(scene, run, Chain(scene, run).bodies.reference())[-1])
    predicted, solver = zhai_limit(0.5, 0.5) / fastest, runner.resolve(name)

    def grown(dt: float) -> bool:
        moved = solver(
            scene, replace(run, dt=dt, t_end=STEPS * dt, output_dt=STEPS // 20 * dt, check_stability=False)
        )
        away = np.abs(moved.displacement("beam.end"))
        return not moved.status.ok or float(away.max()) > FAR * PULL * LENGTH

    measured = largest_stable(grown, 1.02 * predicted, WIDTH_OF_BISECTION)
    return [{
        "what": "solver", "solver": name, **options_of(run), "elements": elements, "E": setting.E,
        "slenderness": setting.slenderness, "state": setting.state, "psi": 0.5, "omega_max": fastest,
        "measured": measured, "predicted": predicted, "difference": off(measured, predicted), "theory": "2/ω_max",
        "reference": "dense eigenvalues", "uncertainty": WIDTH_OF_BISECTION + PULL, "status": "ok",
    }]  # fmt: skip


def step(quick: bool, runner: Runner) -> Part:
    """Measured limits of every scheme, and of every solver that has one."""
    jobs = [
        Job(s.label, {"what": s.what, **options_of(s.run), "elements": s.elements}, partial(limit_row, s))
        for s in settings(quick)
    ]
    jobs += [
        Job(
            f"step, {name}, {n} {element}",
            {"what": "solver", "solver": name, "element": element, "elements": n},
            partial(solver_row, name, element, n, runner),
            name,
        )
        for name, element in SOLVERS
        for n in ((4,) if quick else (4, 16))
    ]
    limits = pd.DataFrame(rows_of(jobs, runner))
    notes = (
        "A clamped beam of 1 m at rest under a dead load is disturbed by 1e-10 at random; measured (s): the largest "
        "step with which that does not grow ten-thousandfold in "
        f"{STEPS} steps ({MANY_STEPS} where ψ > ½), by bisection; uncertainty: its relative width.",
        "omega_max (rad/s): dense eigenvalues of the summed tangents about that equilibrium, that of the torque "
        "included; solver_omega_off: how far the solver's own estimate (Lanczos on differences of elastic forces, "
        "without torques) is off.",
        "solver: where other solvers are named, their runs start from the straight beam, pulled at a little askew; "
        "Exudyn's explicit scheme is velocity Verlet.",
        "state: under a small pull ('at rest'), or far from straight. For ψ = φ > ½ growth beyond the limit is slow, "
        "so the measured limit lies above theory by what that many steps can tell.",
    )
    table = Table("extremes_step", "Largest stable step", limits, notes)
    return Part((table,), (_limits_picture(limits),), (_learned(limits),))


def _learned(limits: pd.DataFrame) -> str:
    sound = limits[limits["status"] == "ok"]
    least = worst(sound, "difference")
    slender = sound[(sound["what"] == "slenderness") & (sound["slenderness"] == sound["slenderness"].max())]
    ratio = _step_of(slender, "cable") / _step_of(slender, "shear")
    return (
        f"Step: over {len(sound)} schemes of {sound['solver'].nunique()} solvers, meshes, stiffnesses, slendernesses "
        "and states far from straight the largest "
        f"stable step is √(2/ψ)/ω_max to {100 * abs(least['difference']):.2f} % at worst ({least['state']}, "
        f"{least['elements']} {least['element']} elements); it is {ratio:.0f} times larger for cables than for shear "
        f"elements at L/h = {slender['slenderness'].iloc[0]:g}, where the thickness of the latter vibrates."
    )


def _step_of(rows: pd.DataFrame, element: str) -> float:
    return float(rows.loc[rows["element"] == element, "measured"].iloc[0])


def _limits_picture(limits: pd.DataFrame) -> Picture:
    sound = limits[limits["status"] == "ok"]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        _over(left, sound[sound["what"] == "mesh"], "elements", "elements")
        _over(right, sound[sound["what"] == "slenderness"], "slenderness", "slenderness L/h")
        right.set_ylabel("")
        legend_below(figure, [left, right], 4)

    away = abs(worst(sound, "difference")["difference"])
    caption = (
        "Largest stable step, measured (markers) on theory (lines), over mesh and slenderness; they differ by "
        f"{100 * away:.2f} % at worst. A cable's step falls with the length of an element, a slender shear element's "
        "with its height for as long as it is longer than high."
    )
    return picture("extremes_step", caption, draw, (7.6, 3.6))


def _over(axes: Axes, rows: pd.DataFrame, x: str, label: str) -> None:
    for (element, rule), mine in rows.groupby(["element", "quadrature"], sort=False):
        mine, name = mine.sort_values(x), element if rule == "-" else f"{element} {rule}"
        i = SCHEMES.index(name)
        colour = PALETTE[i]
        axes.plot(mine[x], mine["predicted"], color=colour, linewidth=1.0)
        axes.plot(
            mine[x], mine["measured"], "osD^"[i], color=colour, label=name, markerfacecolor="none",
            markersize=8.0 - i,
        )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="largest stable step (s)")
