"""Sizes of a scene and of what acts on it over a run, with which errors are compared."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.connectors import Spring
from anctmm.model.drives import tabulate
from anctmm.model.joints import drive_of
from anctmm.model.loads import LineLoad, Torque, load_text, width_of
from anctmm.model.scene import Beam, Load, Scene

EPS = float(np.finfo(float).eps)
#: Times at which drives and loads are looked at, at most: steps of the run, so that none is called at other times.
SEEN = 65


def mass_of(scene: Scene) -> float:
    """Mass of all bodies, kg."""
    return sum(body.mass for body in scene.bodies)


def reach_of(scene: Scene) -> float:
    """Largest coordinate of an end or a point, m."""
    places = ((body, (0.0, 1.0) if isinstance(body, Beam) else body.keys) for body in scene.bodies)
    return max(abs(x) for body, keys in places for key in keys for x in body.position_at(key))  # type: ignore[arg-type]


def weight_of(scene: Scene) -> float:
    """Weight of all bodies, N."""
    return mass_of(scene) * float(np.linalg.norm(scene.gravity))


def load_sizes(scene: Scene, run: Discretisation) -> Iterator[tuple[Load, float]]:
    """Each load and its largest component over a run, N or N m; of a line load on its whole beam."""
    for load in scene.loads:
        values: Any = load.value
        if callable(load.value):
            values = tabulate(load_text(load), load.value, _times(run), width_of(load, scene.dim))
        length = scene.beam(load.body).length if isinstance(load, LineLoad) else 1.0
        yield load, length * float(np.abs(values).max())


def work_of_loads(scene: Scene, run: Discretisation) -> float:
    """Work, J, that weight and loads may do, over the length of all bodies or a whole turn."""
    ways = {True: 2.0 * np.pi, False: scene.length}
    loads = sum(size * ways[isinstance(load, Torque)] for load, size in load_sizes(scene, run))
    return weight_of(scene) * scene.length + loads


def drive_rates(scene: Scene, run: Discretisation) -> Iterator[float]:
    """The largest rate of each driven joint, rad/s; of a guide that of its place, m/s, by the scene's length."""
    for joint in scene.joints:
        if (drive := drive_of(joint)) is not None:
            name, history, unit = drive
            size = 1.0 if unit == "rad" else scene.length
            yield float(np.abs(tabulate(name, history, _times(run), 3)[:, 1]).max()) / size


def is_driven(scene: Scene) -> bool:
    """Whether a joint or a connector is driven."""
    free = (c.length if isinstance(c, Spring) else c.angle for c in scene.connectors)
    return any(drive_of(joint) is not None for joint in scene.joints) or any(map(callable, free))


def _times(run: Discretisation) -> np.ndarray:
    return run.times(np.unique(np.linspace(0, run.steps, SEEN).astype(np.int64)))
