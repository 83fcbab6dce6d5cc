"""Models of the benchmark: one kind of beam with any number of elements, chains of it, and their steps."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import QUADRATURES
from anctmm.integrators.stability import largest_step, safe_step
from anctmm.model.scene import Beam, Clamp, Joint, Material, Pin, Scene, Weld
from anctmm.model.sections import Rectangle

Array = NDArray[np.float64]

SECTION = Rectangle(0.01, 0.005)
MATERIAL = Material(E=1e9, density=2000.0)
#: Length of every element, m, however many there are: a longer chain is longer, not finer.
ELEMENT_LENGTH = 0.02
GRAVITY = (0.0, -9.81)
#: Part of the stability limit that explicit steps take: deformation raises the highest frequency.
MARGIN = 0.8


@dataclass(frozen=True)
class Variant:
    """An element with its quadrature ("-" where there is no choice)."""

    element: str
    quadrature: str

    @property
    def label(self) -> str:
        """As tables and samples call it."""
        return self.element if self.quadrature == "-" else f"{self.element} {self.quadrature}"

    def options(self) -> dict[str, Any]:
        """Fields of a discretisation."""
        given = {} if self.quadrature == "-" else {"quadrature": self.quadrature}
        return {"element": self.element, **given}


SHEAR = Variant("shear", "-")
CABLES = tuple(Variant("cable", q) for q in QUADRATURES)
VARIANTS = (SHEAR, *CABLES)


def row_of_beams(
    bodies: int,
    elements: int,
    joint: Callable[[str, str], Joint] = Pin,
    element_length: float = ELEMENT_LENGTH,
) -> Scene:
    """Equal beams in a straight row, the first one clamped, the last one free, under gravity.

    Parameters
    ----------
    bodies, elements : int
        Number of beams, and of the elements each will be cut into.
    joint : callable
        (end, start of the next) → joint.
    element_length : float
        m.
    """
    length = elements * element_length
    beams = [
        Beam(f"beam{k}", (k * length, 0.0), ((k + 1) * length, 0.0), SECTION, MATERIAL) for k in range(bodies)
    ]
    joints = [joint(f"beam{k}.end", f"beam{k + 1}.start") for k in range(bodies - 1)]
    return Scene(f"row of {bodies}", tuple(beams), (Clamp("beam0.start"), *joints), gravity=GRAVITY)


def on_supports(bodies: int, elements: int) -> Scene:
    """A beam that passes over a support at each joint of its equal spans, clamped at the start."""
    row = row_of_beams(bodies, elements, lambda a, b: Weld(a, b, grounded=True))
    end = Pin(f"beam{bodies - 1}.end")
    return Scene(f"continuous beam of {bodies} spans", row.bodies, (*row.joints, end), gravity=GRAVITY)


def stable_step(scene: Scene, mesh: Any, options: dict[str, Any]) -> float:
    """An explicit step safely below the stability limit, s; infinite where nothing can vibrate."""
    chain = Chain(scene, Discretisation(mesh=mesh, integrator="zhai", dt=1e-3, t_end=1e-3, **options))
    if scene.connectors or chain.bodies.damping is not None:  # the bounds of both together may be far too low
        return MARGIN * largest_step(chain, chain.bodies.reference())
    return MARGIN * safe_step(chain)


def explicit_run(scene: Scene, mesh: Any, steps: int, dt: float, **options: Any) -> Discretisation:
    """So many explicit steps with no output between the first and the last."""
    return Discretisation(
        mesh=mesh, integrator="zhai", dt=dt, t_end=steps * dt, output_dt=steps * dt,
        check_stability=False, **options,
    )  # fmt: skip


def implicit_run(
    scene: Scene, mesh: Any, steps: int, dt: float, newton_tolerance: float = 1e-7, **options: Any
) -> Discretisation:
    """So many steps of generalized-α with no output between the first and the last."""
    return Discretisation(
        mesh=mesh, integrator="generalized-alpha", dt=dt, t_end=steps * dt, output_dt=steps * dt,
        newton_tolerance=newton_tolerance, **options,
    )  # fmt: skip


def rolled_up(chain: Chain) -> Array:
    """Coordinates of a row of beams bent into a circle of radius 1 m, slightly stretched and sheared, (rows, nodes).

    Rolled up, so that places stay small and differences of neighbours keep their digits at any length.
    """
    reference = chain.bodies.reference()
    angle, q = reference[0], np.empty_like(reference)
    q[0], q[1] = 1.001 * np.sin(angle), 1.001 * (1.0 - np.cos(angle))
    q[2], q[3] = 1.001 * np.cos(angle), 1.001 * np.sin(angle)
    if len(q) == 6:
        tilt = angle + 1e-3
        q[4], q[5] = -0.999 * np.sin(tilt), 0.999 * np.cos(tilt)
    return q


def bent_arc(nodes: int, rows: int, angle: float = 1.0) -> Array:
    """Coordinates of one beam bent into an arc, (rows, nodes): what kernels are timed on."""
    chain_angle = np.linspace(0.0, angle, nodes)
    radius = ELEMENT_LENGTH * (nodes - 1) / angle
    q = np.array(
        [(radius * sin(a), radius * (1 - cos(a)), cos(a), sin(a), -sin(a), cos(a)) for a in chain_angle]
    )
    return np.ascontiguousarray(1.001 * q.T[:rows])
