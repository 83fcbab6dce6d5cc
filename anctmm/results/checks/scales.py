"""Sizes of a scene and of what acts on it over a run, with which errors are compared."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.connectors import Spring, name_of
from anctmm.model.drives import tabulate
from anctmm.model.joints import drive_of
from anctmm.model.loads import LineLoad, Torque, load_text, width_of
from anctmm.model.scene import Beam, Load, Scene

Array = NDArray[np.float64]
#: Times at which drives and loads are looked at, at most: steps of the run, so that none is called at other times.
SEEN = 65


class History(NamedTuple):
    """A load, or with a unit a drive of a joint or a connector's free length or angle; it gives `width` numbers."""

    name: str
    history: Callable[[Any], Any]
    width: int
    unit: str = ""

    def at(self, times: Array) -> Array:
        """Values and derivatives, (times, width)."""
        return tabulate(self.name, self.history, times, self.width)

    def moved(self, times: Array) -> Array:
        """Loads, or what a drive adds to its start, (times, numbers)."""
        return self.at(times)[:, :1] - self.at(np.zeros(1))[0, 0] if self.unit else self.at(times)


def histories_of_loads(scene: Scene) -> Iterator[History]:
    """Loads that depend on time."""
    for load in scene.loads:
        if callable(load.value):
            yield History(load_text(load), load.value, width_of(load, scene.dim))


def drives_of(scene: Scene) -> Iterator[History]:
    """Drives of joints, which have three values, and of connectors, which have two."""
    for joint in scene.joints:
        if (drive := drive_of(joint)) is not None:
            yield History(drive[0], drive[1], 3, drive[2])
    for connector in scene.connectors:
        if callable(connector.free):
            unit = "m" if isinstance(connector, Spring) else "rad"
            yield History(f"{name_of(connector)} {connector.free_name}", connector.free, 2, unit)


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
        if callable(values):
            values = tabulate(load_text(load), values, _times(run), width_of(load, scene.dim))
        length = scene.beam(load.body).length if isinstance(load, LineLoad) else 1.0
        yield load, length * float(np.abs(values).max())


def work_of_loads(scene: Scene, run: Discretisation) -> float:
    """Work, J, that weight and loads may do, over the length of all bodies or a whole turn."""
    ways = {True: 2.0 * np.pi, False: scene.length}
    loads = sum(size * ways[isinstance(load, Torque)] for load, size in load_sizes(scene, run))
    return weight_of(scene) * scene.length + loads


def drive_rates(scene: Scene, run: Discretisation) -> Iterator[float]:
    """The largest rate of each driven joint, rad/s; of a guide that of its place, m/s, by the scene's length."""
    for drive in drives_of(scene):
        if drive.width == 3:
            size = 1.0 if drive.unit == "rad" else scene.length
            yield float(np.abs(drive.at(_times(run))[:, 1]).max()) / size


def is_driven(scene: Scene) -> bool:
    """Whether a joint or a connector is driven."""
    return next(drives_of(scene), None) is not None


def _times(run: Discretisation) -> Array:
    return run.times(np.unique(np.linspace(0, run.steps, SEEN).astype(np.int64)))
