"""The runs that are timed: each a scene, a discretisation, and the solvers that run it in turn."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import StabilityError
from anctmm.model.scene import Scene
from studies.benchmark.branched import Graph, add_ladder, add_tree, add_zigzag
from studies.scenes import cantilever_fall, four_bar

OURS, EXUDYN = "anctmm", "exudyn-cable"
SPARSE, DENSE = "global-dae", "global-dae-dense"
#: Meshes of the four-bar, elements of crank, coupler and follower: the paper's, and four times as many.
FOUR_BARS = ((2, 8, 2), (8, 32, 8))
#: Implicit steps, s; explicit ones are as long as is stable, halved from the first of these.
IMPLICIT, EXPLICIT = 1e-3, 1e-3
#: Steps of a run, by what an element and step costs at least: a run takes some tens of milliseconds.
MOST_STEPS, ELEMENT_STEPS = 2000, 4e5
RUBBER, ROD = at.Material(E=5e6, density=1100.0), at.Rectangle(0.02, 0.02)
#: Elements of one clamped beam; the last has 2,000,000 coordinates.
LENGTHS = (1_000, 10_000, 100_000, 500_000)


@dataclass(frozen=True)
class Contest:
    """A run and its solvers, the first of which the others are compared with.

    Parameters
    ----------
    name : str
    scene : Scene
    run : Discretisation
    elements : int
        In all.
    solvers : tuple of str
        Registered names.
    """

    name: str
    scene: Scene
    run: Discretisation
    elements: int
    solvers: tuple[str, ...]

    @property
    def steps(self) -> str:
        """Kind of the steps."""
        return "explicit" if self.run.explicit else "implicit"


def contests(quick: bool) -> Iterator[Contest]:
    """All contests but those of length."""
    yield from _exudyn(quick)
    yield from _paper(quick)
    yield from _kinds(quick)


def _exudyn(quick: bool) -> Iterator[Contest]:
    """The same cables, mesh, quadrature and step in Exudyn: Zhai with ψ = φ = ½ is its velocity Verlet."""
    fall, bar = cantilever_fall().scene, four_bar().scene
    rule: dict[str, Any] = {"quadrature": "reduced"}
    for n in (8, 32) if quick else (8, 32, 128):
        for explicit in (True, False):
            yield _contest("cantilever, like settings", fall, n, explicit, (OURS, EXUDYN), quick, **rule)
    for mesh in FOUR_BARS[: 1 if quick else None]:
        yield _contest("four-bar, like settings", bar, _by_link(mesh), False, (OURS, EXUDYN), quick, **rule)


def _paper(quick: bool) -> Iterator[Contest]:
    """The paper's four-bar of shear elements, explicitly: the global solver factors a dense matrix, or a sparse one."""
    for mesh in FOUR_BARS[: 1 if quick else None]:
        run = _discretisation(_by_link(mesh), 1e-5, 400 if quick else 1000, True, element="shear")
        solvers = (OURS, SPARSE, DENSE)
        yield Contest("four-bar, the paper's elements", four_bar().scene, run, sum(mesh), solvers)


def _kinds(quick: bool) -> Iterator[Contest]:
    """Scenes of several kinds, by both solvers of the same equations."""
    for name, scene, mesh in scenes(10 if quick else 40):
        for explicit in (True, False):
            yield _contest(name, scene, mesh, explicit, (OURS, SPARSE), quick)


def scenes(size: int) -> Iterator[tuple[str, Scene, int]]:
    """Name, scene and elements of each beam, of scenes with about so many bodies."""

    def hung(graph: Graph, name: str, first: str, joint: Any = at.Pin) -> Scene:
        return graph.scene(name, joint, at.Clamp(first), gravity=(0.0, -9.81))

    yield "hinged chain", hung(add_zigzag(Graph(ROD, RUBBER), size), "chain", "z0.start"), 2
    yield "welded tree", hung(add_tree(Graph(ROD, RUBBER), size), "tree", "t0_0.start", at.Weld), 2
    yield "hinged ladder", hung(add_ladder(Graph(ROD, RUBBER), size // 2), "ladder", "r0.start"), 2
    chain = hung(add_zigzag(Graph(ROD, RUBBER), size), "springs", "z0.start")
    springs = [
        at.Spring(f"z{k}.start", f"z{k + 2}.end", stiffness=20.0, damping=0.01) for k in range(0, size - 2, 4)
    ]
    yield "chain with springs", replace(chain, connectors=tuple(springs)), 2


def lengths(quick: bool) -> Iterator[Contest]:
    """One clamped beam of ever more elements of one length, by ANC-TMM."""
    for n in LENGTHS[: 2 if quick else None]:
        beam = at.Beam("beam", (0.0, 0.0), (0.05 * n, 0.0), ROD, RUBBER)
        scene = at.Scene("long beam", [beam], [at.Clamp("beam.start")], gravity=(0.0, -9.81))
        for explicit in (True, False):
            steps = max(10, round((1e5 if quick else 4e5) / n))
            dt = 1e-4 if explicit else IMPLICIT
            yield Contest("long beam", scene, _discretisation(n, dt, steps, explicit), n, (OURS,))


def _contest(
    name: str, scene: Scene, mesh: Any, explicit: bool, solvers: Sequence[str], quick: bool, **options: Any
) -> Contest:
    elements = sum(mesh.values()) if isinstance(mesh, dict) else mesh * len(scene.beams)
    steps = min(MOST_STEPS, max(20, round(ELEMENT_STEPS / elements))) // (10 if quick else 1)
    dt = stable_step(scene, mesh, **options) if explicit else IMPLICIT
    run = _discretisation(mesh, dt, steps, explicit, **options)
    return Contest(name, scene, run, elements, tuple(solvers))


def _discretisation(mesh: Any, dt: float, steps: int, explicit: bool, **options: Any) -> Discretisation:
    """So many steps without output between the first and the last."""
    integrator = "zhai" if explicit else "generalized-alpha"
    return Discretisation(
        mesh, integrator=integrator, dt=dt, t_end=steps * dt, output_dt=steps * dt, **options
    )


def stable_step(scene: Scene, mesh: Any, **options: Any) -> float:
    """A stable explicit step, s: halved until it is not refused, and once more for what moves."""
    dt = EXPLICIT
    while True:
        try:
            at.solve(scene, _discretisation(mesh, dt, 1, True, **options))
            return 0.5 * dt
        except StabilityError:
            dt *= 0.5


def _by_link(mesh: tuple[int, ...]) -> dict[str, int]:
    return dict(zip(("crank", "coupler", "follower"), mesh, strict=True))
