"""`anctmm compile`: kernels compiled beforehand, by one short run of each kind."""

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

import anctmm as at

#: Elements of each block size, those in space, and kinds of calls.
ELEMENTS = ("cable", "shear", "space")
CALLS: dict[str, Callable[..., Any]] = {
    "zhai": partial(at.solve, integrator="zhai", dt=1e-6, t_end=2e-6),
    "generalized-alpha": partial(at.solve, dt=1e-4, t_end=2e-4),
    "esdirk": partial(at.solve, integrator="esdirk", dt=1e-4, t_end=2e-4),
    "generalized-alpha with a tolerance": partial(at.solve, tolerance=1e-2, t_end=1e-3),
    "esdirk with a tolerance": partial(at.solve, integrator="esdirk", tolerance=1e-2, t_end=1e-3),
    "statics": at.solve_static,
    "modes": partial(at.modes, count=2),
}


def compile_kernels(done: Callable[[str], None] = lambda _: None) -> None:
    """Compile what has not been compiled yet."""
    for name, element in product(CALLS, ELEMENTS):
        if (name, element) != ("modes", "space"):
            _call(name, element)
            done(f"{name}, {element}")


def _call(name: str, element: str) -> None:
    """One short call."""
    size = 3 if element == "space" else 2
    start, end, down = (0.0, 0.0, 0.0)[:size], (1.0, 0.0, 0.0)[:size], (0.0, -1.0, 0.0)[:size]
    beam = at.Beam("beam", start, end, at.Circle(0.05), at.Material(E=1e7, density=1000.0))
    scene = at.Scene("compile", [beam], [at.Clamp("beam.start")], gravity=down)
    CALLS[name](scene, mesh=2, element="cable" if size == 3 else element)
