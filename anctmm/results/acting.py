"""What acts on a scene over a run, by its size: for checks that ask how large an energy or a force may be."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.drives import tabulate
from anctmm.model.kept import kept
from anctmm.model.loads import load_text, width_of
from anctmm.model.scene import Beam, Clamp, Load, Scene

#: Times at which drives and loads are looked at, at most: steps of the run, so that none is asked at other times.
SEEN = 65


def length_of(scene: Scene) -> float:
    """Length of all bodies, m."""
    return scene.length


@kept
def mass_of(scene: Scene) -> float:
    """Mass of all bodies, kg."""
    return sum(_mass(body) for body in scene.beams)


def _mass(body: Beam) -> float:
    return body.material.density * body.section.area * body.length


def weight_of(scene: Scene) -> float:
    """Weight of all bodies, N."""
    return mass_of(scene) * float(np.hypot(*scene.gravity))


def load_sizes(scene: Scene, run: Discretisation) -> Iterator[tuple[Load, float]]:
    """Each load and its largest component over a run, N or N m."""
    for load in scene.loads:
        if callable(load.value):
            width = width_of(load)
            values = tabulate(load_text(load), load.value, _times(run), width)
        else:
            values = np.asarray(load.value, dtype=float)
        yield load, float(np.abs(values).max())


def drive_rates(scene: Scene, run: Discretisation) -> Iterator[float]:
    """The largest angular velocity of each driven clamp, rad/s."""
    for joint in scene.joints:
        if isinstance(joint, Clamp) and joint.angle is not None:
            yield float(
                np.abs(tabulate(f"clamp {joint.end!r} angle", joint.angle, _times(run), 3)[:, 1]).max()
            )


def _times(run: Discretisation) -> NDArray[np.float64]:
    return run.times(np.unique(np.linspace(0, run.steps, SEEN).astype(np.int64)))
