"""Size of the loads on a scene over a run, for checks that need a scale of energies or forces."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.bodies import Body
from anctmm.model.drives import tabulate
from anctmm.model.joints import drive_of
from anctmm.model.kept import kept
from anctmm.model.loads import load_text, width_of
from anctmm.model.scene import Beam, LineLoad, Load, Scene

#: Times at which drives and loads are looked at, at most: steps of the run, so that none is asked at other times.
SEEN = 65


def length_of(scene: Scene) -> float:
    """Length of all bodies, m."""
    return scene.length


@kept
def mass_of(scene: Scene) -> float:
    """Mass of all bodies, kg."""
    return sum(body.mass for body in scene.bodies)


def ends_of(body: Body) -> tuple[Any, ...]:
    """Keys of the farthest places of a body."""
    return (0.0, 1.0) if isinstance(body, Beam) else body.keys


@kept
def reach_of(scene: Scene) -> float:
    """Largest coordinate of an end or a point, m."""
    return max(abs(x) for body in scene.bodies for key in ends_of(body) for x in body.position_at(key))


@kept
def weight_of(scene: Scene) -> float:
    """Weight of all bodies, N."""
    return mass_of(scene) * float(np.hypot(*scene.gravity))


def load_sizes(scene: Scene, run: Discretisation) -> Iterator[tuple[Load, float]]:
    """Each load and its largest component over a run, N or N m; of a line load on its whole beam."""
    for load in scene.loads:
        if callable(load.value):
            width = width_of(load)
            values = tabulate(load_text(load), load.value, _times(run), width)
        else:
            values = np.asarray(load.value, dtype=float)
        length = scene.beam(load.body).length if isinstance(load, LineLoad) else 1.0
        yield load, length * float(np.abs(values).max())


def drive_rates(scene: Scene, run: Discretisation) -> Iterator[float]:
    """The largest rate of each drive, rad/s; of a guide that of its place, m/s, by the scene's length."""
    for joint in scene.joints:
        if (drive := drive_of(joint)) is not None:
            name, history, unit = drive
            size = 1.0 if unit == "rad" else scene.length
            yield float(np.abs(tabulate(name, history, _times(run), 3)[:, 1]).max()) / size


def _times(run: Discretisation) -> NDArray[np.float64]:
    return run.times(np.unique(np.linspace(0, run.steps, SEEN).astype(np.int64)))
