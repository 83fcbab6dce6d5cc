"""Runs of a scene, as it is and varied a little: what an answer changes by then is its sensitivity."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import anctmm as at

Point = tuple[float, float]


@dataclass(frozen=True)
class Scaled:
    """The initial velocity of a beam, as a function of the fraction of its length, times a factor."""

    velocity: Callable[[float], Point]
    factor: float

    def __call__(self, fraction: float) -> Point:
        """Velocity (m/s) at a fraction of the length."""
        x, y = self.velocity(fraction)
        return x * self.factor, y * self.factor


@dataclass(frozen=True)
class Variation:
    """How a group of answers is computed.

    Parameters
    ----------
    stretch : float
        Relative change of all lengths and of initial velocities; Young's moduli change by three times as much.
    shift : (float, float)
        Of the whole scene, m: all sums round differently.
    newton_tolerance : float
        Of implicit fixed steps and statics.
    step : float
        Factor of fixed steps.
    """

    stretch: float = 0.0
    shift: Point = (0.0, 0.0)
    newton_tolerance: float = 1e-11
    step: float = 1.0

    def solve(self, scene: at.Scene, start: at.Solution | None = None, **options: Any) -> at.Solution:
        """A motion; `start` is an equilibrium of this variation."""
        if "dt" in options:
            options["dt"] *= self.step
        if "tolerance" not in options and options.get("integrator") != "zhai":
            options.setdefault("newton_tolerance", self.newton_tolerance)
        return at.solve(self.scene(scene), start=start, **options)

    def static(self, scene: at.Scene, **options: Any) -> at.Solution:
        """Equilibria."""
        return at.solve_static(self.scene(scene), newton_tolerance=self.newton_tolerance, **options)

    def modes(self, scene: at.Scene, **options: Any) -> at.Modes:
        """Small motions."""
        return at.modes(self.scene(scene), **options)

    def scene(self, scene: at.Scene) -> at.Scene:
        """The scene, stretched and shifted."""
        if not self.stretch and self.shift == (0.0, 0.0):
            return scene
        connectors = tuple(map(self._connector, scene.connectors))
        return replace(scene, bodies=tuple(map(self._body, scene.bodies)), connectors=connectors)

    def _connector(self, connector: Any) -> Any:
        second = connector.second
        if isinstance(second, tuple) and not isinstance(second[0], str):  # a point of the ground
            return replace(connector, second=self._moved(second))
        return connector

    def _body(self, body: Any) -> Any:
        match body:
            case at.Beam():
                material = replace(body.material, E=body.material.E * (1.0 + 3.0 * self.stretch))
                faster = body.velocity and Scaled(body.velocity, 1.0 + self.stretch)
                start, end = self._moved(body.start), self._moved(body.end)
                return replace(body, start=start, end=end, material=material, velocity=faster)
            case at.RigidBody():
                points = {name: self._moved(p) for name, p in body.points.items()}
                velocity = self._scaled(body.velocity)
                return replace(body, center=self._moved(body.center), points=points, velocity=velocity)
            case at.PointMass():
                return replace(
                    body, position=self._moved(body.position), velocity=self._scaled(body.velocity)
                )
        raise TypeError(f"body {body!r} is of another kind than beam, rigid body or point mass")

    def _scaled(self, vector: Point) -> Point:
        return vector[0] * (1.0 + self.stretch), vector[1] * (1.0 + self.stretch)

    def _moved(self, point: Any) -> Point:
        x, y = self._scaled(point)
        return x + self.shift[0], y + self.shift[1]


#: As it is, and the variations that measure the sensitivity of every answer.
PLAIN = Variation()
SMALL = {
    "data": Variation(stretch=1e-12),
    "rounding": Variation(shift=(0.37, -0.21)),
    "iteration": Variation(newton_tolerance=1e-12),
}
#: The variation for answers that depend on how a step reads accelerations.
HALF_STEP = Variation(step=0.5)
