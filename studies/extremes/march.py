"""Explicit steps from any state, and the largest step from which a tiny disturbance does not grow."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.joined import Joined
from anctmm.elements.kinds import kind_of
from anctmm.integrators import zhai as explicit
from anctmm.model.scene import Scene
from anctmm.results.solution import Solution
from anctmm.solve import solve_static

Array = NDArray[np.float64]

#: Size of the disturbance, of the scene's length; it must stay small enough to be linear until it counts as grown.
DISTURBANCE = 1e-10
#: A disturbance that has grown by this counts as unstable: just below a limit it swells by some ten or hundred times.
GROWN = 1e4


@dataclass(frozen=True)
class _BodiesAt(Bodies):
    """Bodies whose reference is where a run shall start; their strains are still those of the straight bodies."""

    at: Array

    def reference(self) -> Array:
        """The coordinates given, (rows, nodes)."""
        return self.at.copy()


@dataclass(frozen=True)
class ChainAt(Chain):
    """A chain whose runs start from given coordinates, (rows, nodes), at rest."""

    at: Array

    @cached_property
    def bodies(self) -> Bodies:
        """Bodies in the order and direction of the chain."""
        return _BodiesAt(Chain(self.scene, self.run).bodies.meshes, self.at)


def equilibrium(scene: Scene, run: Discretisation, load_steps: int = 1) -> Array:
    """Coordinates of the static equilibrium under the scene's loads, (rows, nodes)."""
    bodies = Chain(scene, run).bodies
    if not scene.loads and scene.gravity == (0.0, 0.0):
        return bodies.reference()
    rest = solve_static(
        scene, mesh=run.mesh, element=run.element, quadrature=run.quadrature, load_steps=load_steps,
        newton_tolerance=1e-12,
    )  # fmt: skip
    if not rest.status.ok:
        raise np.linalg.LinAlgError(f"no static equilibrium: {rest.status}")
    return bodies.flat([rest.fields[m.body.name].coordinates[-1] for m in bodies.meshes])  # type: ignore[attr-defined]


def disturbed(chain: Chain, q: Array, seed: int = 0) -> Array:
    """Coordinates with a tiny random disturbance that the joints allow."""
    join = Joined(chain)
    noise = join.spread(np.random.default_rng(seed).standard_normal(join.size))
    noise[:2] *= chain.length
    return q + DISTURBANCE * noise


def grows(scene: Scene, run: Discretisation, q: Array, steps: int, dt: float) -> bool:
    """Whether a tiny disturbance of rest at q grows over so many steps."""
    stride = max(1, steps // 16)
    run = replace(run, dt=dt, t_end=steps * dt, output_dt=stride * dt, check_stability=False)
    start = disturbed(Chain(scene, run), q)
    moved = explicit.integrate(ChainAt(scene, run, start))
    return not moved.status.ok or _furthest(moved, q, scene, run) > GROWN * DISTURBANCE


def _furthest(moved: Solution, q: Array, scene: Scene, run: Discretisation) -> float:
    """Largest distance from q of a history: positions by the scene's length, gradients as they are."""
    bodies = Chain(scene, run).bodies
    worst = 0.0
    length = sum(b.length for b in scene.beams)
    for name, rest in bodies.by_body(q).items():
        away: Array = np.abs(moved.fields[name].coordinates - rest)  # type: ignore[attr-defined]
        worst = max(worst, float(away[:, :, 0].max()) / length, float(away[:, :, 1:].max()))
    return worst


def largest_stable(grown: Callable[[float], bool], guess: float, width: float) -> float:
    """Largest step that does not grow, by bisection to a relative width, from a guess.

    Returns
    -------
    float
        0 if every step down to a thousandth of the guess grows, infinity if none up to a thousandfold does.
    """
    low, high = guess, guess
    while grown(low):
        high, low = low, 0.5 * low
        if low < 1e-3 * guess:
            return 0.0
    while not grown(high):
        low, high = high, 1.5 * high
        if high > 1e3 * guess:
            return float("inf")
    while high - low > width * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grown(middle) else (middle, high)
    return 0.5 * (low + high)


def options_of(run: Discretisation) -> dict[str, Any]:
    """The settings that identify a scheme, for a row."""
    return {"element": run.element, "quadrature": kind_of(run.element).quadrature_shown(run.quadrature)}
